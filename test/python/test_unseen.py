"""What the fit never saw decides: names that foretell it worse go, and what nothing foretells better is the better baseline's."""

from __future__ import annotations

import warnings
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis, doubt
from ninespring.find.diagnosis import first_fit
from ninespring.find.evidence import likelihood
from ninespring.find.lasting import likeliest
from ninespring.find.residual import depends_on
from ninespring.find.search import Search
from ninespring.find.unseen import LAG, OF_THAT_DAY, Unseen, _hardly_shown, errors, pinned, splits
from ninespring.infer import budget
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.likelihood import NONE, Colour
from ninespring.infer.predict import predict
from ninespring.infer.problem import Problem
from ninespring.infer.result import model_of
from ninespring.infer.scene import scene_of
from ninespring.io import results
from ninespring.io.logs.run import Run
from ninespring.io.statistics import rms
from ninespring.model import effects as library
from ninespring.model.effects.runs_differ import ALIKE
from ninespring.model.models import Array, Model
from ninespring.model.spec import RUN_AMBIENT, Free, Spec


def model(*effects: str) -> Any:
    return SimpleNamespace(spec=SimpleNamespace(effects=effects, variant=tuple((one, "") for one in effects)))


class Told(Unseen):
    """Errors of models as they are told, K, by their effects; 'lag' is the baseline's."""

    def __init__(self, errors: dict[str, float], true: dict[str, float] | None = None) -> None:
        self.known_k, self.true = errors, true or {}
        self.problem = SimpleNamespace(colour=None)  # type: ignore[assignment]
        self.splits = [SimpleNamespace(alone=True)]  # type: ignore[list-item]
        self.base, self.lagged = model(), model(LAG)
        self.lag = SimpleNamespace(effect=LAG)  # type: ignore[assignment]
        self.accounts = ()

    def rmse(self, fit: Any, colour: Any = None) -> float:
        return self.known_k["lag" if fit is self.lagged else " ".join(fit.spec.effects)]

    def own(self, fit: Any) -> float:
        return self.rmse(fit)

    def foretells(self, fit: Any, colour: Any = None) -> float:
        return self.rmse(fit)

    def comes_true(self, fit: Any, without: Any) -> float:
        return self.true.get(*(set(fit.spec.effects) - set(without.spec.effects)), 1.0)


def without(fit: Any, effect: str) -> Any:
    return model(*(one for one in fit.spec.effects if one != effect))


def test_a_name_with_which_the_unseen_is_foretold_worse_goes_and_is_told() -> None:
    told = Told({"": 2.0, "lag": 1.0, "shared_air sensor_gain": 3.0, "shared_air": 0.9, "sensor_gain": 4.0})
    kept, said = told.kept(model("shared_air", "sensor_gain"), without)
    assert kept is not None and kept.spec.effects == ("shared_air",)
    assert len(said) == 1 and said[0].startswith("sensor_gain is not named") and "3.00 K with it and to 0.90" in said[0]


def test_a_name_that_others_carry_along_goes_by_itself() -> None:
    errors = {"": 2.0, "lag": 2.0, "shared_air sensor_gain": 1.19, "shared_air": 1.29, "sensor_gain": 3.0}
    both = model("shared_air", "sensor_gain")
    kept, said = Told(errors, {"sensor_gain": 0.64}).kept(both, without)
    assert kept is not None and kept.spec.effects == ("shared_air",)
    assert len(said) == 1 and said[0].startswith("sensor_gain is not named") and said[0].endswith("64% comes true")
    kept, said = Told(errors, {"sensor_gain": 0.95}).kept(both, without)
    assert kept is both and not said


def test_a_name_without_which_twice_as_much_of_the_unseen_is_left_stays_however_little_comes_true() -> None:
    """It foretells most of what is off without it, which no stand-in does: what it overdoes is its numbers, which a part tells badly."""
    errors = {"": 2.0, "lag": 2.0, "shared_air sensor_gain": 0.9, "shared_air": 2.3, "sensor_gain": 3.0}
    both = model("shared_air", "sensor_gain")
    kept, said = Told(errors, {"sensor_gain": 0.72}).kept(both, without)
    assert kept is both and not said


def test_a_run_in_which_all_models_err_does_not_outweigh_the_others() -> None:
    """A run began hot after nobody saw what: there a true lag foretells worse by chance, in both others many times better."""
    told = Told({})
    each = {"": (1.6, 1.5, 0.7), LAG: (0.4, 2.4, 0.2)}
    told.errors = lambda fit, colour=None: ([np.full(900, k) for k in each[" ".join(fit.spec.effects)]],) * 2  # type: ignore[method-assign]
    told.rmse = lambda fit, colour=None: Unseen.rmse(told, fit, colour)  # type: ignore[method-assign]
    told.foretells = lambda fit, colour=None: Unseen.foretells(told, fit, colour)  # type: ignore[method-assign]
    assert rms([np.full(900, k) for k in each[LAG]]) > rms([np.full(900, k) for k in each[""]])
    assert told.better is told.lagged and told.plain is told.lagged
    assert Unseen.rmse(told, model(LAG)) == pytest.approx((0.4 * 2.4 * 0.2) ** (1 / 3))
    told.problem = SimpleNamespace(colour=None, noise_c=0.1)  # type: ignore[assignment]
    each = {"": (1.0, 10.0), LAG: (0.1, 12.0)}
    assert Unseen.comes_true(told, model(LAG), model()) > 0.75, (
        "of what it changes nine tenths come true in one, nothing in the other"
    )


@pytest.mark.parametrize("there", [0.0, 0.5, 1.0])
def test_what_comes_true_of_an_effect_is_what_of_its_change_is_in_the_unseen(there: float) -> None:
    shift = 0.7 * np.sin(np.arange(400.0))
    told = Told({})
    told.problem = SimpleNamespace(colour=None, noise_c=0.3)  # type: ignore[assignment]
    left = {"": there * shift, "shared_air": (there - 1.0) * shift}
    # by what is left when rooms are apart, whatever else is off
    told.errors = lambda fit, colour=None: ([shift + 9.0], [left[" ".join(fit.spec.effects)]])  # type: ignore[method-assign]
    assert Unseen.comes_true(told, model("shared_air"), model()) == pytest.approx(there)
    told.problem.noise_c = 3.0
    assert Unseen.comes_true(told, model("shared_air"), model()) == np.inf, (
        "both foretell the same: nothing is told of it"
    )


def test_where_nothing_foretells_as_well_the_baseline_is_the_answer() -> None:
    told = Told({"": 2.0, "lag": 1.0, "shared_air": 3.0})
    kept, said = told.kept(model("shared_air"), lambda fit, effect: model("shared_air"))
    assert kept is None and len(said) == 1
    kept, said = Told({"": 2.0, "lag": 1.0}).kept(model(), without)
    assert kept is None and not said


def test_what_is_of_that_day_is_not_judged_by_another() -> None:
    told = Told({"": 0.5, "lag": 0.5, "ambient_drift": 1.0, RUN_AMBIENT: 1.0})
    told.splits = [SimpleNamespace(alone=False)]  # type: ignore[list-item]
    for effect in ("ambient_drift", RUN_AMBIENT):
        kept, said = told.kept(model(effect), without)
        assert kept is not None and kept.spec.effects == (effect,) and not said


def test_the_rest_of_a_run_alone_is_in_the_room_that_it_began_in() -> None:
    told = Told({"": 0.5, "lag": 0.5, RUN_AMBIENT: 1.0})
    kept, said = told.kept(model(RUN_AMBIENT), without)
    assert kept is not None and kept.spec.effects == (), "judged like any other"
    assert said[0].startswith("run_ambient_offset is not named")
    both = model(RUN_AMBIENT, "ambient_drift")
    for off, stays in ((2.0, False), (0.5, True)):
        told = Told({"": 0.5, "lag": 0.5, RUN_AMBIENT: 1.0, f"{RUN_AMBIENT} ambient_drift": off})
        carried = told.carried(both, without)
        assert (carried is both) == stays, "a drift goes its own way where it does not foretell the rest"
        assert stays or carried.spec.effects == (RUN_AMBIENT,)


def test_what_is_of_the_array_is_judged_without_what_is_of_that_day() -> None:
    """One run less tells of a drift too little to tell the rest beside it: that is no fault of the rest."""
    errors = {"": 1.0, "lag": 1.0, "radiation": 0.8, "ambient_drift": 2.2, "radiation ambient_drift": 1.7}
    both = model("radiation", "ambient_drift")
    kept, said = Told(errors).kept(both, without)
    assert kept is both and not said
    assert Told(errors).carried(both, without).spec.effects == ("radiation",)
    kept, said = Told(errors, {"radiation": -1.2}).kept(both, without)
    assert kept is both and not said, "another day's drift is in what comes true of it"
    kept, said = Told(errors | {"radiation": 1.2}).kept(both, without)
    assert kept is not None and kept.spec.effects == ("ambient_drift",), (
        "what foretells worse by itself goes, the drift stays"
    )
    assert len(said) == 1 and said[0].startswith("radiation is not named")


@pytest.mark.parametrize(("lag", "taken"), [(0.99, False), (0.9, True)])
def test_a_lag_that_foretells_no_better_is_left_out_of_the_baseline(lag: float, taken: bool) -> None:
    told = Told({"": 1.0, "lag": lag})
    search = SimpleNamespace(base=told.base, refit=lambda fit, added, sizes: told.lagged)
    assert (told.refitted(search, told.plain) is told.lagged) == taken  # type: ignore[arg-type]


@pytest.mark.parametrize("unjudged", [True, False])
@pytest.mark.parametrize("worth", [True, False])
def test_a_lag_that_foretells_better_is_in_the_model_and_a_name_only_where_it_explains_what_a_name_must(
    monkeypatch: pytest.MonkeyPatch, worth: bool, unjudged: bool
) -> None:
    told = Told({"": 1.0, "lag": 0.8, "shared_air": 0.7})
    told.accounts = [model("shared_air")] if unjudged else []
    search = SimpleNamespace(base=told.base, refit=lambda *_: told.lagged, worth=lambda *_: worth, reduced=without)
    monkeypatch.setattr(diagnosis.search, "Search", lambda *_: search)
    monkeypatch.setattr(diagnosis, "_finish", lambda problem, fit: fit)
    monkeypatch.setattr(diagnosis, "_of_account", lambda *_: search)  # nothing of it is sure
    began = SimpleNamespace(candidates=[], progress=None)
    case: Any = SimpleNamespace(final=told.base, declared=told.base, search=began, instead=None)
    case.hidden, case.adopted = [], []
    case.problem = SimpleNamespace(colour=None, take_for=lambda colour: None)
    headline = diagnosis._foretold(case, search, told)  # type: ignore[arg-type]
    assert headline is not None and headline.rmse_c == (0.7 if unjudged else 0.8)
    assert f"declared model with {'shared_air' if unjudged else 'a lag'}" in headline.text
    assert case.final is (told.lagged if worth else told.base), "what was not judged is no name"
    assert (case.instead is not None) == (unjudged or not worth)


def test_an_effect_without_which_most_is_not_foretold_is_no_stand_in() -> None:
    told = Told({"": 2.0, "lag": 2.0, "latent_heat": 1.3, "shared_air": 1.6})
    assert told.tells(model("latent_heat"), model())
    assert not told.tells(model("shared_air"), model())


@pytest.mark.parametrize(
    ("told", "given_k", "without_k", "true", "alone"),
    [
        (True, 1.42, 1.23, 0.76, False),
        (False, 1.41, 1.23, 0.76, False),  # all that was found foretells less than half
        (False, 1.42, 1.22, 0.76, False),  # less than a third is foretold with it
        (False, 1.42, 1.23, 0.74, False),  # what it changes does not come true
        (False, 1.42, 1.23, np.inf, False),  # it changes nothing
        (False, 1.42, 1.23, 0.76, True),  # its last part is the same run's
    ],
)
def test_of_many_that_are_there_none_foretells_most(
    told: bool, given_k: float, without_k: float, true: float, alone: bool
) -> None:
    found = Told({"": given_k, "lag": 2.0, "shared_air": without_k, "shared_air supply_sag": 1.0}, {"supply_sag": true})
    found.splits = [SimpleNamespace(alone=alone)]  # type: ignore[list-item]
    assert found.tells(model("shared_air", "supply_sag"), model("shared_air")) == told


@pytest.mark.parametrize(
    ("taken", "left", "names", "bends", "off_k"),
    [
        ("same", False, ["shared_air"], ["ambient_drift"], 2.0),  # nothing is left: nobody looks for more
        ("same", True, ["shared_air"], ["ambient_drift"], 1.06),
        ("found", True, ["shared_air"], ["ambient_drift"], 1.04),
        ("found", True, [], ["ambient_drift"], 2.0),  # no name takes the place of what bends
        ("same", True, ["shared_air"], [], 2.0),  # what bent was not sure enough and fell, and nothing took its place
        ("found", True, ["shared_air"], ["shared_air", "ambient_drift"], 2.0),
        ("same", True, ["shared_air"], ["radiation"], 2.0),  # found beside something that bent
        ("found", True, ["shared_air"], ["radiation"], 1.04),
        ("found", True, ["sensor_lag"], ["ambient_drift", "hidden"], 2.0),  # what has no name is in no model
    ],
)
def test_what_bends_as_it_likes_gives_way_to_a_name_that_foretells_better(
    monkeypatch: pytest.MonkeyPatch, taken: str, left: bool, names: list[str], bends: list[str], off_k: float
) -> None:
    hidden = "hidden" in bends
    cases = {
        True: SimpleNamespace(adopted=names, hidden=[], fits={1: "a"}, off_k=1.0),
        False: SimpleNamespace(adopted=bends, hidden=["a cause"] if hidden else [], fits={}, off_k=off_k),
    }
    for case in cases.values():
        case.loose = []
        case.problem = case.final = case.search = case.declared = None
    given: list[Any] = []

    monkeypatch.setattr(diagnosis, "prepare", lambda *_: None)
    monkeypatch.setattr(diagnosis, "_begun", lambda *begun: given.append(begun[-1]))
    monkeypatch.setattr(diagnosis, "_loose", lambda *_: None)
    monkeypatch.setattr(diagnosis, "_searched", lambda _, alike: cases[alike])
    monkeypatch.setattr(diagnosis, "_judged", lambda *_: None)
    monkeypatch.setattr(diagnosis, "unexplained", lambda *_: left)
    monkeypatch.setattr(diagnosis.unseen, "Unseen", lambda *_: SimpleNamespace(accounts=()))
    monkeypatch.setattr(diagnosis, "_off", lambda case, *_: case.off_k)
    monkeypatch.setattr(diagnosis, "_rested", lambda *_: None)
    monkeypatch.setattr(diagnosis, "_accounts", lambda case: case.adopted)

    def silent(text: str) -> None:
        pass

    runs: Any = [None, None]
    case, _, judged_by = diagnosis._foretelling(Array(1, 2), runs, None, False, silent)
    assert case is cases[taken == "same"]
    assert judged_by.accounts == (names if left else ()), "they may be given where something is left, whatever is named"
    assert given == ([None, {1: "a"}] if left else [None]), "what one search fitted serves the other"
    assert diagnosis._foretelling(Array(1, 2), runs[:1], None, False, silent)[0] is cases[False], "a run alone"
    assert diagnosis._foretelling(Array(1, 2), runs, None, True, silent)[0] is cases[False], "as it is given"


@pytest.mark.parametrize("alike", [True, False])
def test_what_is_the_same_in_all_runs_is_no_drift_and_nothing_of_a_run_alone(
    monkeypatch: pytest.MonkeyPatch, alike: bool
) -> None:
    class Begun(Exception):
        pass

    def begin(problem: Any, candidates: Any, *_: Any) -> None:
        raise Begun({one.effect for one in candidates if one.variant != ALIKE})

    monkeypatch.setattr(diagnosis.search, "Search", begin)
    runs = [replace(one_node(0.0, seed), ambient_c=ambient) for seed, ambient in ((1, None), (2, np.full(600, 20.0)))]
    with pytest.raises(Begun) as begun:
        diagnosis._begun(Problem(Array(1, 1), runs), None, False, lambda text: None, alike)
    (effects,) = begun.value.args
    assert "natural_convection" in effects
    assert ("ambient_drift" in effects, bool(effects & set(OF_THAT_DAY))) == (not alike, not alike)


@pytest.mark.parametrize("named", [True, False])
def test_what_has_no_name_is_not_looked_for_where_only_names_count(
    monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    looked: list[str] = []
    monkeypatch.setattr(diagnosis.unnamed, "search_beside", lambda *_: looked.append("beside"))
    monkeypatch.setattr(diagnosis.lasting, "search_lasting", lambda *_: ("again", ("lasting", {}, [])))
    monkeypatch.setattr(diagnosis.lasting, "nats_beside", lambda problem, fit, *_: 2.0 if fit == "lasting" else 1.0)
    problem: Any = SimpleNamespace(unnamed=None, heat=None, leave_out=lambda what: None)
    first: Any = SimpleNamespace(progress=lambda text: None)
    final: Any = "final"
    found = diagnosis._where_something_is_left(problem, first, (final, {}, []), named)
    assert found == ("again", ("lasting", {}, []), [])
    assert looked == ([] if named else ["beside"])


@pytest.mark.parametrize(("squares_k", "runs"), [(0.9, 2), (1.1, 2), (0.9, 1)])
def test_numbers_that_foretell_runs_left_out_better_are_given_to_what_was_found(
    monkeypatch: pytest.MonkeyPatch, squares_k: float, runs: int
) -> None:
    """By least squares, or with what lasts taken for noise: what the model lacks is no noise, and may be foretold worse so."""
    told = Told({"": 2.0, "lag": 2.0, "shared_air": squares_k})
    monkeypatch.setattr(told, "own", lambda fit: 1.0)
    monkeypatch.setattr(told, "carried", lambda fit, reduced: fit)
    again: list[Any] = []

    def by_least_squares(case: Any, found: Any) -> Any:
        assert found is case.final
        again.append(case)
        return SimpleNamespace(reduced=without)

    monkeypatch.setattr(diagnosis, "_by_least_squares", by_least_squares)
    monkeypatch.setattr(diagnosis, "_given", lambda *_: None)
    problem = SimpleNamespace(colour="lasts", runs=[None] * runs)
    case: Any = SimpleNamespace(problem=problem, hidden=[], final=model("shared_air"), not_kept=[])
    judge: Any = SimpleNamespace(reduced=without)
    diagnosis._foretold(case, judge, told)
    assert again == ([case] if squares_k < 1.0 and runs > 1 else [])


def test_by_least_squares_everything_is_fitted_so_again() -> None:
    problem = Problem(Array(1, 1), [one_node(1.0, seed) for seed in (1, 2)], {"heat_capacity_j_per_k": 2.0})
    base = first_fit(problem, base_spec(problem))
    likelihood(problem, base)
    problem.take_for(base.colour)
    lasting = problem.fit(base.spec, base.as_dict(), errors=True)
    case: Any = SimpleNamespace(problem=problem, declared=base, final=lasting, contenders=[("a", lasting)], fits={})
    case.search, case.adopted = SimpleNamespace(candidates=[], progress=lambda text: None), []
    judge = diagnosis._by_least_squares(case, lasting)
    assert problem.colour is None and case.search is judge and judge.base is base
    for fit in (case.final, case.contenders[0][1]):
        assert fit.sse < lasting.sse and fit.sse == pytest.approx(base.sse, rel=1e-4)
    case.fits = {case.search.key(base.spec): replace(base, sse=7.0)}
    diagnosis._by_least_squares(case, lasting)
    assert case.contenders[0][1].sse == 7.0, "what the first search has fitted so is not fitted again"
    case.fits = {case.search.key(base.spec): replace(lasting, sse=7.0)}
    diagnosis._by_least_squares(case, lasting)
    assert case.contenders[0][1].sse != 7.0, "that was fitted otherwise"


@pytest.mark.parametrize(("found_k", "plain"), [(1.04, False), (1.2, True)])
def test_what_foretells_worse_than_the_better_baseline_keeps_its_name_and_the_baseline_is_the_model(
    found_k: float, plain: bool
) -> None:
    """Beside a cause without a name, or of that day alone: no name is judged there."""
    told = Told({"": 2.0, "lag": 1.0, "shared_air": found_k})
    case: Any = SimpleNamespace(instead=None)
    headline = diagnosis._given(case, told, model("shared_air"))
    assert headline is not None and (case.instead is not None) == plain
    assert headline.rmse_c == (1.0 if plain else found_k), "it is the error of the model that is given"
    assert (
        "declared model with a lag, by least squares: with what was found it would be 1.20 K" in headline.text
    ) == plain


@pytest.mark.parametrize(("found_k", "lag_k", "given"), [(1.06, 1.06, True), (1.04, 1.06, False), (1.06, 1.04, False)])
def test_what_least_squares_found_is_given_where_it_foretells_better_and_names_nothing(
    found_k: float, lag_k: float, given: bool
) -> None:
    """Than what is named, and than the better baseline: what is no sure cause may foretell all the same."""
    told = Told({"": 2.0, "lag": lag_k, "shared_air": found_k, "radiation sensor_gain": 1.0})
    told.accounts = [model("radiation", "sensor_gain")]
    case: Any = SimpleNamespace(instead=None, final=(found := model("shared_air")))
    headline = diagnosis._given(case, told, found)
    assert headline is not None and (case.instead is not None) == given and case.final is found
    assert headline.rmse_c == (1.0 if given else found_k)
    assert (
        "with radiation and sensor_gain, each named or not, by least squares: with what was" in headline.text
    ) == given
    assert told.better is told.lagged, "names are judged beside what knows no physics but the declared"


@pytest.mark.parametrize(
    ("names", "found_k"), [(("radiation",), 1.04), (("radiation",), 1.2), (("radiation", RUN_AMBIENT), 1.04)]
)
def test_what_is_sure_of_an_account_that_foretells_runs_better_is_named_in_place_of_what_was_found(
    monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], found_k: float
) -> None:
    """Better than what would be given of that: beside what is of that day, where the rest alone foretells worse."""
    errors = {"": 3.0, "lag": 3.0, "radiation": 1.2, "latent_heat": 1.02, "latent_heat sensor_gain": 1.0}
    errors[" ".join(names)] = found_k
    told = Told(errors)
    told.accounts = [model("latent_heat", "sensor_gain")]

    def by_least_squares(case: Any, found: Any) -> Any:
        case.final, case.adopted = found, list(found.spec.effects)
        return SimpleNamespace(reduced=without)

    monkeypatch.setattr(diagnosis, "_by_least_squares", by_least_squares)
    monkeypatch.setattr(diagnosis, "_finish", lambda problem, fit: fit)
    monkeypatch.setattr(diagnosis, "_doubtful", lambda case, judged_by, fresh: ["sensor_gain"])
    monkeypatch.setattr(diagnosis, "witness", lambda *_: None)
    told.splits = [SimpleNamespace(alone=False)]  # type: ignore[list-item]
    case: Any = SimpleNamespace(problem=told.problem, final=model(*names), hidden=[], instead=None, witnesses={})
    case.problem.runs = [None, None]
    headline = diagnosis._foretold(case, SimpleNamespace(reduced=without), told)  # type: ignore[arg-type]
    better = found_k > 1.05
    assert case.final.spec.effects == (("latent_heat",) if better else names)
    assert headline is not None and headline.rmse_c == (1.02 if better else found_k)
    assert case.instead is None, "what is named foretells as well"


def test_of_accounts_that_are_near_the_one_that_foretells_best_is_given_and_the_likeliest_where_none_does() -> None:
    """What is likeliest here may be far off in a run that was left out; what foretells as well to a twentieth is chance."""
    told = Told({"": 2.0, "lag": 2.0, "shared_air": 1.0, "radiation": 0.96, "radiation sensor_gain": 0.5})
    near = [model("shared_air"), model("radiation"), model("radiation", "sensor_gain")]
    told.accounts = near
    assert told.instead is near[2]
    told.accounts = near[:2]
    assert told.instead is near[0]
    told.accounts = [model("")]
    assert told.instead is told.plain


@pytest.mark.parametrize("foretells", [None, ("shared_air",), ("shared_air", "radiation")])
def test_a_name_that_what_foretells_better_has_not_is_no_more_than_probable(
    monkeypatch: pytest.MonkeyPatch, foretells: tuple[str, ...] | None
) -> None:
    sure = SimpleNamespace(probability=lambda: 0.98)
    free = SimpleNamespace(effect="radiation", key="emissivity")
    fit: Any = SimpleNamespace(
        spec=SimpleNamespace(free=[free], variant=()), residual=[np.zeros(1)], at_bounds=lambda: []
    )
    case: Any = SimpleNamespace(problem=SimpleNamespace(holdout_rmse=lambda _: 1.0), final=fit)
    case.witnesses, case.instead = {"radiation": sure, "shared_air": sure}, foretells and model(*foretells)
    monkeypatch.setattr(diagnosis, "parameters_of", lambda *_: {})
    monkeypatch.setattr(diagnosis.effects, "sentence", lambda *_: "")
    listed, _ = diagnosis._listed(
        case, [("radiation", fit), ("shared_air", fit)], {"radiation": 9.0, "shared_air": 9.0}
    )
    assert [one.certainty for one in listed] == [
        "probable" if foretells == ("shared_air",) else "certain",
        "certain",
    ]
    assert all((one.probability >= 0.9) == (one.certainty == "certain") for one in listed)


@pytest.mark.parametrize(
    ("variant", "beside", "mode", "told"),
    [
        ("sensor 2", (), "command", "probable"),
        ("sensor 2", ("holder_mass",), "power", "probable"),
        ("sensor 2", ("shared_air",), "power", "certain"),
        ("all sensors", ("holder_mass",), "power", "certain"),
    ],
)
def test_a_thermometers_gain_is_not_certain_where_its_spring_may_be_unlike_the_others(
    monkeypatch: pytest.MonkeyPatch, variant: str, beside: tuple[str, ...], mode: str, told: str
) -> None:
    """Found in logs of heaters with unlike fins: one thermometer 'reads less', certainly."""
    spec = SimpleNamespace(free=[], effects=("sensor_gain", *beside), variant=(("sensor_gain", variant),))
    fit: Any = SimpleNamespace(spec=spec, residual=[np.zeros(1)], at_bounds=lambda: [])
    problem = SimpleNamespace(holdout_rmse=lambda _: 1.0, runs=[SimpleNamespace(mode=mode)])
    sure = SimpleNamespace(probability=lambda: 0.98)
    case: Any = SimpleNamespace(problem=problem, final=fit, witnesses={"sensor_gain": sure}, instead=None)
    monkeypatch.setattr(diagnosis, "parameters_of", lambda *_: {})
    monkeypatch.setattr(diagnosis.effects, "sentence", lambda *_: "Thermometer 2 reads 9 % less.")
    (one,), _ = diagnosis._listed(case, [("sensor_gain", fit)], {"sensor_gain": 9.0})
    assert one.certainty == told and ("Exchange two thermometers" in one.text) == (told == "probable")


@pytest.mark.parametrize(("beside_k", "dropped"), [(1.04, False), (1.2, True)])
def test_numbers_that_foretell_worse_beside_what_is_of_that_day_are_given_as_they_are_without(
    monkeypatch: pytest.MonkeyPatch, beside_k: float, dropped: bool
) -> None:
    """What bends takes up what is the array's, and goes: its numbers would be those of no array."""
    found = model("shared_air", "ambient_drift")
    told = Told({"": 3.0, "lag": 2.0, "shared_air": 1.0, "shared_air ambient_drift": beside_k})
    told.splits = [SimpleNamespace(alone=False)]  # type: ignore[list-item]
    assert told.given(found, told.carried(found, without)).spec.effects == (
        ("shared_air",) if dropped else found.spec.effects
    )
    monkeypatch.setattr(diagnosis, "_finish", lambda problem, fit: fit)
    case: Any = SimpleNamespace(problem=told.problem, final=found, hidden=[], carried=None, instead=None)
    headline = diagnosis._foretold(case, SimpleNamespace(reduced=without), told)  # type: ignore[arg-type]
    assert case.final is found, "what was found is told"
    assert headline is not None and headline.rmse_c == (1.0 if dropped else beside_k), "of the model that is given"
    assert (case.carried is not None) == dropped


def test_the_model_that_is_given_foretells_in_the_rooms_that_first_minutes_tell() -> None:
    """What would be better in rooms that nobody knows predicts no run."""

    class InTheirRooms(Told):
        def foretells(self, fit: Any, colour: Any = None) -> float:
            return super().foretells(fit) + (2.0 if "shared_air" in fit.spec.effects else 0.5)

    case: Any = SimpleNamespace(instead=None)
    told = InTheirRooms({"": 2.0, "lag": 1.0, "shared_air": 0.9})
    headline = diagnosis._given(case, told, model("shared_air"))
    assert headline is not None and case.instead and headline.rmse_c == 1.5


def test_the_baseline_that_is_given_is_the_one_that_foretells_better_in_rooms_that_first_minutes_tell() -> None:
    class InTheirRooms(Told):
        def foretells(self, fit: Any, colour: Any = None) -> float:
            return super().foretells(fit) + (3.0 if fit is self.lagged else 1.0)

    told = InTheirRooms({"": 2.0, "lag": 1.0})
    assert told.better is told.lagged and told.plain is told.base


def test_what_was_found_beside_a_cause_without_a_name_stays_as_large_where_it_foretells() -> None:
    """In the runs that are fitted the cause still acts: there its size would be another."""
    free = (
        Free("loss_w_per_k", 0.01, 1e-4, 1.0, "W/K", log=True),
        Free("air", 2.0, 0.0, 9.0, "J/K", effect="shared_air"),
    )
    stays = Free("ambient_offset_k@1", 0.0, -9.0, 9.0, "K", effect=RUN_AMBIENT, run=0)
    fit = Fit(Spec(("shared_air", RUN_AMBIENT), (), (*free, stays)), np.array([0.02, 5.0, 1.0]), 0.0, 1, [])
    loss, air, room = pinned(fit).spec.free
    assert (loss, room) == (free[0], stays), "declared numbers and those of a run alone are fitted as ever"
    assert air.start == 5.0 and air.prior is not None and air.prior < 1e-3


def one_node(wander_k: float, seed: int = 1) -> Run:
    """Return ten minutes of one node in a known room, its thermometer astray for minutes at a time."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(600.0)
    drive = np.repeat(rng.choice([0.0, 1.0], 10), 60)[:, None]
    shown, astray = np.full(600, 20.0), np.zeros(600)
    for k in range(1, 600):
        shown[k] = shown[k - 1] + (0.5 * drive[k - 1, 0] - 0.01 * (shown[k - 1] - 20.0)) / 2.0
        astray[k] = 0.995 * astray[k - 1] + 0.1 * wander_k * rng.standard_normal()
    read = (shown + astray + 0.05 * rng.standard_normal(600))[:, None]
    return Run("one", "", time_s, "command", drive, read, np.zeros(600), np.full(600, 20.0))


@pytest.mark.parametrize("springs", [1, 2])
def test_what_shows_the_same_in_commands_is_looked_for_once(springs: int) -> None:
    """A gain of all thermometers is the commands' power; a spring alone is as late by its thermometer as by itself."""
    run = one_node(0.0)
    wide = replace(
        run, drive=np.repeat(run.drive, springs, axis=1), temperature_c=np.repeat(run.temperature_c, springs, axis=1)
    )
    known = library.candidates(scene_of(Problem(Array(1, springs), [wide])))
    assert not [one for one in known if one.variant == "all sensors"]
    unlogged = library.candidates(scene_of(Problem(Array(1, springs), [replace(wide, ambient_c=None)])))
    assert [one for one in unlogged if one.variant == "all sensors"], "beside no log of the room it stands for both"
    assert [one.mirror is not None for one in known if one.effect == LAG] == [springs > 1]


def test_a_spring_that_no_log_drives_is_said() -> None:
    """Of its commands nothing is known: a run that drives it was foretold at 218 degC."""
    run = one_node(0.0)
    first = np.hstack([run.drive, 0.0 * run.drive])
    wide = replace(run, drive=first, temperature_c=np.repeat(run.temperature_c, 2, axis=1))
    said = doubt.never_driven(Problem(Array(1, 2), [wide, wide]))
    assert len(said) == 1 and said[0].startswith("spring 2 is driven in none of these logs")
    assert doubt.never_driven(Problem(Array(1, 2), [wide, replace(wide, drive=first[:, ::-1])])) == []
    assert doubt.never_driven(Problem(Array(1, 2), [replace(wide, mode="power")])) == []


def test_a_room_drifts_no_faster_than_rooms_do() -> None:
    """What heats springs by 48 K/h for two minutes goes on so in no longer run: it is nearer to them than the room."""
    known = library.candidates(scene_of(Problem(Array(1, 1), [one_node(0.0)])))
    (ramp,) = next(one.free for one in known if one.variant == "ramp")
    assert [ramp.outer(ramp.inner(rate)) for rate in (-48.0, 5.0, 48.0)] == [-20.0, 5.0, 20.0]


def test_a_run_alone_is_foretold_from_its_half_and_from_two_thirds() -> None:
    problem = Problem(Array(1, 1), [one_node(0.0)], {"heat_capacity_j_per_k": 2.0})
    assert [int(one.counts.sum()) for one in splits(problem)] == [300, 200]
    for one in splits(problem):
        assert one.alone and not (np.isfinite(one.problem.runs[0].temperature_c) & one.counts).any()


@pytest.mark.parametrize("wander_k", [0.0, 3.0])
def test_each_account_is_taken_at_its_likeliest(wander_k: float) -> None:
    problem = Problem(Array(1, 1), [one_node(wander_k)], {"heat_capacity_j_per_k": 2.0})
    fit = first_fit(problem, base_spec(problem))
    other = likeliest(problem, fit)
    assert problem.colour is None, "as it was"
    if wander_k:
        assert likelihood(problem, other) > likelihood(problem, fit) + 0.1
    else:
        assert likelihood(problem, other) >= likelihood(problem, fit)


def test_a_declared_number_that_a_part_hardly_shows_stays_as_all_had_it() -> None:
    """The fan of one run alone: what a breath of it in the other makes of the loss would be said of whatever is judged by both."""
    free = [Free(key, 1.0, 0.1, 10.0, "W/K", (key,), True) for key in ("loss_w_per_k", "loss_fan_w_per_k")]
    free.append(Free("gain", 1.0, 0.1, 10.0, "1", ("gain",), True, effect="sensor_gain"))
    spec = Spec(("sensor_gain",), (), tuple(free), ())

    def told(*information: float) -> Any:
        return SimpleNamespace(spec=spec, jacobian=np.sqrt(np.diag(information)))

    assert _hardly_shown(told(100.0, 100.0, 100.0), told(50.0, 2.0, 2.0), [0]) == ["loss_fan_w_per_k"]
    assert _hardly_shown(told(100.0, 100.0, 100.0), told(50.0, 50.0, 2.0), [0]) == [], (
        "an effect's own number is judged"
    )


def test_the_number_of_a_run_that_is_left_out_is_none_of_those_that_stay() -> None:
    """Of three runs the third is the second of those that stay: the left-out one's room says nothing of its."""
    of_all, of_part = (
        SimpleNamespace(
            spec=Spec((), (), tuple(Free(f"ambient_c@{r + 1}", 20.0, 0.0, 40.0, "degC", run=r) for r in runs), ()),
            jacobian=np.sqrt(np.diag(information)),
        )
        for runs, information in (((0, 1, 2), (50.0, 100.0, 5.0)), ((0, 1), (50.0, 5.0)))
    )
    assert _hardly_shown(of_all, of_part, [0, 2]) == []  # type: ignore[arg-type]
    of_part.jacobian = np.sqrt(np.diag((50.0, 0.4)))
    assert _hardly_shown(of_all, of_part, [0, 2]) == ["ambient_c@2"]  # type: ignore[arg-type]


def in_turn(which: tuple[int, ...], rows: int, seed: int) -> Run:
    """Return a run of two heaters of which some are driven, for a third of it and for a quarter at half; the room is logged."""
    drive, shown, warm = np.zeros((rows, 2)), np.empty((rows, 2)), np.full(2, 21.0)
    for k in which:
        drive[60 : 60 + rows // 3, k], drive[60 + rows // 2 : 60 + 3 * rows // 4, k] = 1.0, 0.5
    for n in range(rows):
        shown[n] = warm
        warm = warm + (0.5 * drive[n] - 0.0085 * (warm - 21.0) + 0.0022 * (warm[::-1] - warm)) / 2.0
    shown += np.random.default_rng(seed).normal(0.0, 0.3, shown.shape)
    return Run("heater", "", np.arange(float(rows)), "command", drive, shown, np.zeros(rows), np.full(rows, 21.0))


def test_beside_what_stays_as_all_had_it_the_rest_is_fitted_again() -> None:
    """Each heater by itself for long, both for three minutes: of what is left out those tell power and loss together, neither alone. A power
    that stays beside a loss that was found with another one foretold runs to a kelvin."""
    off = []
    for seed in range(3):
        runs = [in_turn((0,), 1200, seed), in_turn((1,), 1200, 10 + seed), in_turn((0, 1), 180, 20 + seed)]
        problem = Problem(Array(1, 2), runs, HEATERS)
        known = library.candidates(scene_of(problem))
        base = first_fit(problem, base_spec(problem))
        spec = next(one for one in known if one.variant == "spring 2").added_to(base.spec)
        fit = problem.fit(spec, base.as_dict(), errors=True)
        off += [rms([errors(split, fit, None)[1]]) for split in splits(problem)[:2]]
    assert rms([np.array(off)]) < 0.36, "its noise is 0.3"


def test_the_baseline_with_a_lag_is_fitted_to_all_runs_too() -> None:
    """What a part of the runs hardly shows stays as it was beside a lag, not as it was without."""
    problem = Problem(Array(1, 2), [heaters(22.0, 1, bent=0.0), heaters(20.0, 2, bent=0.0)], HEATERS)
    base = first_fit(problem, base_spec(problem))
    lagged = Unseen(problem, Search(problem, library.candidates(scene_of(problem)), base), base).lagged
    assert lagged.value("sensor_lag_s") == pytest.approx(25.0, rel=0.1)
    assert rms(lagged.residual) < 0.5 * rms(base.residual)


def heaters(
    room_c: float, seed: int, warm_k: float = 0.0, later_k: float = 0.0, late_s: float = 25.0, bent: float = 0.02
) -> Run:
    """Return 720 s of two heaters, the first driven: late thermometers, a loss that grows with what is lost, no ambient logged; the
    room becomes so much warmer after a minute."""
    rng = np.random.default_rng(seed)
    drive, shown = np.zeros((720, 2)), np.empty((720, 2))
    drive[70:230, 0] = drive[430:590, 0] = 1.0
    warm = room_c + warm_k * np.array([1.0, 0.6])
    read = warm.copy()
    for n in range(720):
        shown[n] = read
        above = warm - room_c - later_k * (n >= 60)
        flow = drive[n] - 0.012 * above * (1.0 + bent * above) + 0.006 * (warm[::-1] - warm)
        read, warm = read + (warm - read) / late_s, warm + flow / 2.0
    shown = np.round((shown + rng.normal(0.0, 0.05, shown.shape)) / 0.1) * 0.1
    return Run("heater", "", np.arange(720.0), "command", drive, shown, np.zeros(720), None)


HEATERS = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "command_power_w": 1.0}


@pytest.mark.parametrize("warm_k", [0.0, 18.0])
def test_rooms_that_were_not_logged_do_not_stand_in_for_what_a_model_lacks(warm_k: float) -> None:
    """The declared model has neither lag nor that loss: free, rooms are 5 K off."""
    problem = Problem(Array(1, 2), [heaters(22.0, 1, warm_k), heaters(20.0, 2), heaters(21.0, 3)], HEATERS)
    fit = first_fit(problem, base_spec(problem))
    assert np.sqrt(np.nanmean(np.concatenate(fit.residual) ** 2)) > 1.0
    for run, (room_c, off) in enumerate(((22.0, 9.0 if warm_k else 2.2), (20.0, 2.2), (21.0, 2.2))):
        assert fit.value(f"ambient_c@{run + 1}") == pytest.approx(room_c, abs=off)


def test_models_are_judged_by_what_a_room_that_was_not_logged_does_not_explain() -> None:
    """The room of the run that is left out changed after the minute that tells it: no model is to blame for that."""
    plain = {"late_s": 1.0, "bent": 0.0}
    runs = [heaters(22.0, 1, **plain), heaters(20.0, 2, **plain), heaters(21.0, 3, later_k=-2.0, **plain)]
    problem = Problem(Array(1, 2), runs, HEATERS)
    fit = first_fit(problem, base_spec(problem))
    told, judged = errors(splits(problem)[-1], fit, None)
    logged = Problem(Array(1, 2), [replace(run, ambient_c=np.full(720, 21.0)) for run in runs], HEATERS)
    same = errors(splits(logged)[-1], first_fit(logged, base_spec(logged)), None)
    assert np.mean(judged**2) < 0.5 * np.mean(told**2) and same[0] is same[1]
    by = Told({"": 1.0, "lag": 2.0})
    by.errors = lambda fit, colour=None: ([np.full(4, 3.0)], [np.full(4, 1.0)])  # type: ignore[method-assign]
    assert Unseen.rmse(by, model()) == 1.0 and Unseen.foretells(by, model()) == pytest.approx(3.0)


def test_a_spring_that_was_never_measured_and_a_gap_are_no_warning() -> None:
    run = heaters(22.0, 1)
    shown = run.temperature_c.copy()
    shown[:, 1] = shown[300:340] = np.nan
    problem = Problem(Array(1, 2), [replace(run, temperature_c=shown)], HEATERS)
    fit = first_fit(problem, base_spec(problem))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        named, said = depends_on(problem, fit)
    assert named and "spring 1" in said


def crossed(room_c: float, seed: int) -> Run:
    """Return 420 s of two heaters, the first of which also heats the other's spring: nothing in the library does."""
    rng = np.random.default_rng(seed)
    drive, shown, read, warm = np.zeros((420, 2)), np.empty((420, 2)), np.full(2, room_c), np.full(2, room_c)
    drive[30:] = np.repeat(rng.choice([0.0, 0.5, 1.0], (2, 8)), 60, axis=1)[:, :390].T
    for n in range(420):
        shown[n] = read
        flow = drive[n] @ [[1.0, 0.3], [0.0, 1.0]] - 0.012 * (warm - room_c) + 0.006 * (warm[::-1] - warm)
        read, warm = warm, warm + flow / 2.0
    shown = np.round((shown + rng.normal(0.0, 0.05, shown.shape)) / 0.1) * 0.1
    return Run("heater", "0" * 64, np.arange(420.0), "command", drive, shown, np.zeros(420), np.full(420, room_c))


def test_what_least_squares_found_is_the_model_and_no_certain_name_where_it_predicts_better(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(budget, "ENOUGH", 3000)  # a search of seconds
    given = Model(Array(1, 2), parameters=dict(HEATERS))
    found = diagnosis.diagnose(Array(1, 2), [crossed(22.0, 1), crossed(20.0, 2)], model=given)
    told, made = found.told, found.model.effects
    assert isinstance(told.unseen, results.Unseen) and told.unexplained
    assert len(set(made) - set(found.effects)) > 1, "it is given, whatever of it is named"
    assert all(one.certainty == "probable" for one in told.effects)
    assert f"The model is the declared model with {' and '.join(made)}, each named or not" in told.unseen.text
    assert not any(one.on_chip for one in told.effects)
    assert told.unseen.rmse_c < 0.8 * min(told.unseen.declared_rmse_c, told.unseen.with_lag_rmse_c)
    for run in (crossed(21.0, seed) for seed in (7, 8, 9)):
        each = found.model, model_of(found.problem, found.final, found.problem.runs)
        off = [rms([run.temperature_c - predict(one, run)]) for one in each]
        assert off[0] < 0.8 * off[1], "and it does, in a run that nobody fitted"


def alone(later: float, seed: int) -> Run:
    """Return a heater's run of an hour in its logged room: it loses so much more in its second half."""
    rng = np.random.default_rng(seed)
    drive, shown, warm = np.zeros((3600, 1)), np.empty((3600, 1)), 21.0
    drive[:, 0] = np.repeat(rng.uniform(0.0, 1.0, 24), 150)
    for n in range(3600):
        shown[n] = warm
        warm += (drive[n, 0] - 0.012 * (1.0 + later * (n >= 1800)) * (warm - 21.0)) / 2.0
    shown += rng.normal(0.0, 0.1, shown.shape)
    return Run("heater", "", np.arange(3600.0), "command", drive, shown, np.zeros(3600), np.full(3600, 21.0))


def test_what_was_fitted_by_least_squares_is_foretold_by_the_parts_of_a_run_alone_however_those_are_weighed() -> None:
    """Beside slopes that were weighed otherwise all of its numbers seemed hardly shown by a part, and stayed as the rest had told them: what
    was told as unseen had been fitted."""
    problem = Problem(Array(1, 1), [alone(0.5, 1)], HEATERS)
    base = first_fit(problem, base_spec(problem))
    lasts = Colour(apart=(300.0, NONE), time_s=(60.0, 3600.0))
    problem.take_for(lasts)
    own = problem.fit(base.spec, base.as_dict(), errors=True)
    by = Unseen(problem, Search(problem, [], base), base)
    own_k = by.foretells(own, lasts)
    by.known.clear()
    assert by.foretells(base, lasts) == pytest.approx(own_k, rel=0.05)


def test_what_stays_as_all_runs_had_it_does_not_hang_on_the_model_that_is_judged() -> None:
    """One that leaves a number open would have had it told by what is left out, and been judged by what was fitted."""
    problem = Problem(Array(1, 1), [alone(0.5, 1)], HEATERS)
    base = first_fit(problem, base_spec(problem))
    by = Unseen(problem, Search(problem, [], base), base)
    own_k = by.rmse(base)
    assert base.jacobian is not None and by.stay == [[], []]
    by.known.clear()
    assert by.rmse(replace(base, jacobian=100.0 * base.jacobian)) == own_k
