from pathlib import Path

import pytest

from pumplib.errors import ParameterError
from pumplib.machines import load_losses, load_motor, load_pump, read_sheet, shipped
from pumplib.machines.sheets import STATUSES

MOTOR = Path(shipped()["motors/reference_1k5"]).read_text(encoding="utf-8")
R_S = 'r_s = { value = 4.1, unit = "ohm", status = "assumed", source = "own" }'


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", shipped())
def test_shipped_files_are_read_and_every_value_has_its_origin(name: str) -> None:
    sheet = read_sheet(shipped()[name])
    assert sheet.parts
    for field, origin in sheet.origins.items():
        assert origin.status in STATUSES, field
        assert len(origin.source) > 10, field


def test_the_required_machines_are_shipped() -> None:
    assert {"motors/im_18k5", "motors/im_2k2", "motors/reference_1k5", "pumps/multistage_1k5"} <= shipped().keys()


def test_2k2_facts_come_back_from_the_converted_circuit() -> None:
    motor = load_motor("im_2k2")
    assert (motor.r_s, motor.z_p) == (3.7, 2)
    assert motor.R_r_prime == pytest.approx(2.1, rel=1e-12)
    assert motor.L_s_prime == pytest.approx(0.021, rel=1e-12)
    assert motor.L_m_prime == pytest.approx(0.224, rel=1e-12)


def test_a_file_of_ones_own_is_loaded_by_path(tmp_path: Path) -> None:
    assert load_motor(write(tmp_path, MOTOR)) == load_motor("reference_1k5")


@pytest.mark.parametrize(
    ("new", "message"),
    [
        (
            'r_s = { value = 4.1, unit = "H", status = "assumed", source = "own" }',
            r"motor\.r_s = 4\.1 H: .*does not measure ohm",
        ),
        (
            'r_s = { value = -4.1, unit = "ohm", status = "assumed", source = "own" }',
            r"motor\.r_s = -4\.1 ohm: must be > 0 ohm",
        ),
        (
            'r_s = { value = "4.1", unit = "ohm", status = "assumed", source = "own" }',
            r"motor\.r_s = '4\.1': must be a number",
        ),
        (
            'r_s = { value = true, unit = "ohm", status = "assumed", source = "own" }',
            r"motor\.r_s = True: must be a number",
        ),
        (
            'r_s = { value = nan, unit = "ohm", status = "assumed", source = "own" }',
            r"motor\.r_s = nan ohm: must be finite",
        ),
        ('r_s = { unit = "ohm", status = "assumed", source = "own" }', r"motor\.r_s: value is missing"),
        ('r_s = { value = 4.1, status = "assumed", source = "own" }', r"motor\.r_s: unit is missing"),
        (
            'r_s = { value = 4.1, unit = "ohm", status = "guessed", source = "own" }',
            r"r_s\.status = 'guessed': must be one of",
        ),
        (
            'r_s = { value = 4.1, unit = "ohm", status = "assumed", source = "x" }',
            r"r_s\.source = 'x': not in \[sources\]",
        ),
        ('r_s = { value = 4.1, unit = "ohm", status = "assumed", source = "own", unt = 1 }', r"unknown key 'unt'"),
        ("r_s = 4.1", r"motor\.r_s = 4\.1: write \{ value"),
        ("", r"motor\.r_s is missing: give the stator resistance of a phase in ohm"),
        (R_S + "\nr_x = 1", r"motor\.r_x: unknown field; allowed are r_s"),
    ],
)
def test_a_wrong_file_names_field_value_unit_and_remedy(tmp_path: Path, new: str, message: str) -> None:
    assert R_S in MOTOR
    with pytest.raises(ParameterError, match=message) as caught:
        read_sheet(write(tmp_path, MOTOR.replace(R_S, new)))
    assert "mine.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        (2900, "rad/s", "rpm"),  # rpm written as rad/s
        (304, "rpm", "rpm against rad/s"),  # rad/s written as rpm
        (304, "l/min", "does not measure rad/s"),
    ],
)
def test_swapped_rpm_and_rad(tmp_path: Path, value: float, unit: str, message: str) -> None:
    line = f'rated_speed = {{ value = {value}, unit = "{unit}", status = "assumed", source = "own" }}'
    with pytest.raises(ParameterError, match=message):
        read_sheet(write(tmp_path, MOTOR.replace("[motor]", "[motor]\n" + line)))


def test_right_rpm_is_converted(tmp_path: Path) -> None:
    line = 'rated_speed = { value = 2900, unit = "rpm", status = "assumed", source = "own" }'
    motor = load_motor(write(tmp_path, MOTOR.replace("[motor]", "[motor]\n" + line)))
    assert motor.rated_speed == pytest.approx(303.687, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = [", "not readable as TOML"),
        (MOTOR.replace("[motor]", "[engine]"), r"unknown table \[engine\]"),
        (MOTOR.replace("name =", "nam ="), "name is missing"),
    ],
)
def test_broken_files(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        read_sheet(write(tmp_path, text))


def test_inverse_gamma_table_is_complete_or_refused(tmp_path: Path) -> None:
    text = Path(shipped()["motors/im_2k2"]).read_text(encoding="utf-8")
    without = "\n".join(line for line in text.splitlines() if not line.startswith("L_M"))
    with pytest.raises(ParameterError, match=r"inverse_gamma\.L_M: is missing"):
        read_sheet(write(tmp_path, without))
    twice = text.replace(
        "[motor]", '[motor]\nr_s = { value = 1, unit = "ohm", status = "typical", source = "motulator" }'
    )
    with pytest.raises(ParameterError, match="give the same thing"):
        read_sheet(write(tmp_path, twice))


def test_absent_names_list_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"motor 'im_99': no such shipped file.*reference_1k5"):
        load_motor("im_99")
    with pytest.raises(ParameterError, match="no such parameter file"):
        load_motor(tmp_path / "none.toml")
    with pytest.raises(ParameterError, match=r"has no table \[losses\]"):
        load_losses("reference_1k5")
    with pytest.raises(ParameterError, match=r"has no table \[pump\]"):
        load_pump(shipped()["motors/im_2k2"])
