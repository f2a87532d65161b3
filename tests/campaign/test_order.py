"""Campaign files: read strictly, refused in one line before anything starts."""

import msgspec
import numpy as np
import pytest

from fgnav.campaign.fly import check_order
from fgnav.campaign.order import Run, load_order, runs_of, seed_of
from fgnav.checks import BadInputError

GOOD = """
seed = 1
flights = 2
[[method]]
method = "rtk"
[[case]]
name = "sine"
scenario = "demo"
"""


def written(tmp_path, text):
    path = tmp_path / "campaign.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (GOOD.replace("seed = 1", "sed = 1"), "sed: unknown; the nearest known key is seed"),
        (GOOD.replace("flights = 2", ""), "'flights' is missing"),
        (GOOD.replace("flights = 2", "flights = 0"), "flights: must be"),
        (GOOD.replace('[[method]]\nmethod = "rtk"', "method = []"), "method"),
        (GOOD + '[[case]]\nname = "sine"\nscenario = "demo"\n', "two are named 'sine'"),
        (GOOD.replace("seed = 1", 'seed = 1\nbaseline = "rkt"'), "baseline: must be one of rtk"),
        (GOOD + 'sweep = { name = "x", values = [1, 2], keys = { a = [1] } }\n', "wants true or 2"),
        (GOOD + 'name = "a/b"\n', "TOML"),
    ],
)
def test_a_bad_file_is_one_line_with_its_key(tmp_path, text, named):
    with pytest.raises(BadInputError, match=r"campaign\.toml") as error:
        load_order(written(tmp_path, text))
    assert named in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (GOOD.replace('"rtk"', '"rkt"'), "method 'rkt'"),
        (GOOD.replace('method = "rtk"', 'method = "rtk"\nintegers = "luck"'), "luck"),
        (GOOD.replace('method = "rtk"', 'method = "rtk"\nwithout = ["radar"]'), "radar"),
        (GOOD.replace('"demo"', '"omed"'), "case 'sine'"),
        (GOOD + 'changes = { "motion.rol.amplitude_deg" = 3 }\n', "case 'sine'"),
        (GOOD + "changes = { duration_s = -1 }\n", "case 'sine'"),
    ],
)
def test_what_cannot_be_had_is_named_before_any_run(tmp_path, text, named):
    order = load_order(written(tmp_path, text))
    with pytest.raises(BadInputError, match=named):
        check_order(order)


def test_columns_share_their_draws_and_flights_do_not(order):
    a, b, c = (seed_of(order, Run(case=0, column=k, flight=f)) for k, f in ((0, 0), (1, 0), (0, 1)))
    assert np.array_equal(a.generate_state(4), b.generate_state(4))
    assert not np.array_equal(a.generate_state(4), c.generate_state(4))


def test_conditions_fly_every_case_with_the_same_draws(tmp_path):
    text = GOOD + "changes = { duration_s = 1.0 }\n"
    for name, noise_m in (("code", 0.3), ("carrier", 0.003)):
        text += f'[condition.{name}]\n"gnss.code_noise_m" = {noise_m}\n'
    order = load_order(written(tmp_path, text), flights=5)
    assert [case.title for case in order.case] == ["sine, code", "sine, carrier"]
    assert order.case[1].changes == {"duration_s": 1.0, "gnss.code_noise_m": 0.003}
    assert order.flights == 5
    check_order(order)
    states = [seed_of(order, Run(case=k, column=0, flight=0)).generate_state(4) for k in (0, 1)]
    assert np.array_equal(*states)
    with pytest.raises(BadInputError, match="--flights: must be 1 or more, got 0"):
        load_order(written(tmp_path, text), flights=0)


def test_a_campaign_cut_short_has_some_of_everything(order):
    first = list(runs_of(order))[:3]
    assert {(run.case, run.column) for run in first} == {(0, 0), (0, 1), (1, 0)}


def test_more_flights_are_the_same_campaign_and_another_seed_is_not(order):
    more = msgspec.structs.replace(order, flights=50)
    other = msgspec.structs.replace(order, seed=8)
    assert more.digest == order.digest != other.digest
