"""A campaign file says what is run; what it says wrongly is named."""

import copy

import numpy as np
import pytest

from pumplib.campaign import SCHEMES, campaign_from, campaigns, load_campaign, load_scheme
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Parameters


def test_cells_are_expanded_in_order(campaign) -> None:
    assert [cell.name for cell in campaign.cells] == ["healthy", "shift size=1", "shift size=2.5"]
    assert [cell.runs for cell in campaign.cells] == [40, 25, 25]
    assert [cell.settings.size for cell in campaign.cells] == [0.0, 1.0, 2.5]
    assert [cell.settings.many for cell in campaign.cells] == [1, 3, 3]
    assert campaign.swept == ("size", "many")
    assert campaign.runs == 90
    assert campaign.scaled(0.1) == (4, 2, 2)
    assert campaign.scaled(1e-6) == (1, 1, 1)


def test_each_makes_the_product_of_its_lists(raw) -> None:
    cell = {"name": "all", "role": "fault", "runs": 1, "each": {"size": [1.0, 2.0], "kind": ["step", "ramp"]}}
    found = campaign_from(raw(settings={}, cells=[cell]), "product")
    assert [(c.settings.size, c.settings.kind) for c in found.cells] == [
        (1.0, "step"), (1.0, "ramp"), (2.0, "step"), (2.0, "ramp"),
    ]  # fmt: skip


def test_more_runs_are_the_same_campaign(raw) -> None:
    more = copy.deepcopy(raw())
    more["cells"][0]["runs"] = 4000
    more["title"] = "another"
    assert campaign_from(more, "shifts").definition() == campaign_from(raw(), "shifts").definition()
    assert campaign_from(raw(seed=8), "shifts").definition() != campaign_from(raw(), "shifts").definition()


def cells(**changes):
    return {"cells": [{"name": "a", "role": "fault", "runs": 2, **changes}]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scheme": "shfted"}, "did you mean 'shifted'"),
        ({"sed": 3}, r"campaign x\.sed: unknown.*did you mean 'seed'"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": 1.5}, "whole"),
        ({"class": "certain"}, "replicated, reconstructed, beyond"),
        ({"title": 3}, "title = 3"),
        ({"profile": "pump"}, "runs on no bench profile"),
        ({"settings": {"siz": 1.0}}, r"settings\.siz: unknown.*did you mean 'size'"),
        ({"settings": {"size": 99.0}}, r"cell 'healthy'.settings: Settings.size = 99 sigma.*<= 10 sigma"),
        ({"settings": {"size": "big"}}, "must be a number in sigma"),
        ({"settings": {"kind": "jump"}}, "must be one of step, ramp"),
        ({"settings": 3}, "must be a table"),
        ({"cells": []}, "at least one"),
        ({"cells": 3}, "list of tables"),
        ({"cells": [3]}, "must be a table"),
        (cells(runs=0), "runs = 0: must be >= 1"),
        (cells(runs=True), "runs = True"),
        (cells(runs=2.5), "whole number"),
        (cells(role="sick"), "must be one of threshold, healthy, fault"),
        (cells(rolle="x"), "did you mean 'role'"),
        (cells(each={"size": []}), "at least one value"),
        (cells(each={"size": [1.0]}, settings={"size": 2.0}), "leave it out there"),
        (cells(each={"size": [1.0, 1.0]}), "is there twice"),
        ({"cells": [{"name": "a", "role": "fault"}]}, "runs: is missing"),
    ],
)
def test_mistakes_are_named(raw, changes, message) -> None:
    with pytest.raises(ParameterError, match=message):
        campaign_from(raw(**changes), "x")


def test_missing_field(raw) -> None:
    content = raw()
    del content["seed"]
    with pytest.raises(ParameterError, match=r"seed: is missing; needed are title, section"):
        campaign_from(content, "x")


def test_files(tmp_path) -> None:
    with pytest.raises(ParameterError, match="did you mean 'cusum_run_length'"):
        load_campaign("cusum_run_lenght")
    (tmp_path / "bad.toml").write_text("seed = = 3")
    with pytest.raises(ParameterError, match="not readable as TOML"):
        load_campaign("bad", tmp_path)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ParameterError, match="not readable as TOML"):
        load_campaign(tmp_path / "bytes.toml")


@pytest.mark.parametrize("factor", [0.0, -1.0, 1.5, float("nan")])
def test_share_must_be_one(campaign, factor) -> None:
    with pytest.raises(ParameterError, match="runs_scale"):
        campaign.scaled(factor)


@pytest.mark.parametrize("name", SCHEMES)
def test_registered_schemes_are_there(name) -> None:
    found = load_scheme(SCHEMES[name])
    assert found.name == name
    assert issubclass(found.settings, Parameters)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("pumplib.nowhere", "cannot be imported"),
        ("pumplib.paths:nothing", "cannot be imported"),
        ("pumplib.paths", "has no name, settings, score"),
    ],
)
def test_what_is_no_scheme(path, message) -> None:
    with pytest.raises(ParameterError, match=message):
        load_scheme(path)


@pytest.mark.parametrize("name", campaigns())
def test_shipped_campaigns_load(name) -> None:
    found = load_campaign(name)
    assert found.runs > 0
    seeds = {load_campaign(other).seed for other in campaigns()}
    assert len(seeds) == len(campaigns())  # campaigns do not share their randomness


def test_generators_of_runs_differ() -> None:
    first = {np.random.default_rng([7, c, k]).integers(2**63) for c in range(20) for k in range(50)}
    assert len(first) == 1000
