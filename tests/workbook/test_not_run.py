"""A claim that cannot be measured on this machine is shown as not run with its reason, and is no error."""

from pumplib.workbook.claims import Measurement, load_claims
from pumplib.workbook.collect import collect, problems


def test_a_claim_without_a_value_is_not_run() -> None:
    ledger = {name: claim for name, claim in load_claims().items() if name == "ch6.c_code"}
    absent = Measurement(id="ch6.c_code", value=None, note="no C compiler")
    assert not problems(ledger, "06_structural_observers", [absent])
    (row,) = collect(ledger, {"06_structural_observers": [absent]}, {}, {})
    assert (row["verdict"], row["note"], row["value"]) == ("not run", "no C compiler", None)
