import pytest

from pumplib.machines import PumpSet, load_application, load_motor, load_pump


@pytest.fixture(scope="session")
def machine() -> PumpSet:
    return PumpSet(
        motor=load_motor("reference_1k5"),
        pump=load_pump("multistage_1k5"),
        application=load_application("multistage_1k5"),
    )
