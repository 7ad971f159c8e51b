"""Steps of a dense fit: clock, metric, median, exemplars, refinement, one after the other."""

from functools import partial

import numpy as np
from sklearn.utils import Bunch, check_random_state

from ..matching.consensus import choose_exemplars
from ..matching.holdout import Verdict
from ..matching.matcher import Matcher
from ..matching.median import Median, estimate_distances, rounding_of, search_median, sum_all
from ..matching.refinement import choose_smoothing
from ..matching.warper import RefinedWarper, Warper
from ..matching.warps import normalise
from ..work import LongWorkMixin, run
from .balance import warn_of_one_feature
from .base import Synchronizer
from .compared import Compared
from .drawing import draw, typical_share
from .portions import compare_in_portions, shared_training_set
from .settings import Settings, features_of, learn_metric
from .trial import try_refinement

__all__ = ["DenseSteps"]

# Up to so many performances all pairs are compared: see docs/scaling.md.
_EXHAUSTIVE = 100

# Whether refining helps is tried on at most so many performances.
_TRIED = 12


class DenseSteps(LongWorkMixin, Synchronizer):
    """How a `DenseSynchronizer` learns; the parameters are its own."""

    def _check_training_set(self, X):
        some, sample, population = draw(X, self.max_fit, self.pattern, self.random_state)
        numbers = None if sample is None else sample.tolist()
        performances = super()._check_training_set(some, numbers)
        n = len(performances)
        self.sample_ = np.arange(n) if sample is None else sample
        self._population = n if sample is None else population
        return performances

    def _number_as_given(self):
        sample, distances = self.sample_, np.full(self._population, np.nan)
        distances[sample] = self.global_distances_
        self.global_distances_, self.exemplars_ = distances, sample[self.exemplars_]
        if self.pattern_index_ is not None:
            self.pattern_index_ = int(sample[self.pattern_index_])
        if self.metric_ is not None:
            self.metric_.performances = sample[self.metric_.performances]

    def _learn(self, performances):
        with self._progress(fits=True) as progress:
            training = self._set_clock(performances)
            learns = self.metric == "learned" and self.cost == "velocity" and self.consensus > 0
            Settings.of(self, learns).check(self.n_frames_, self.subframes)
            positions, self.metric_ = self._positions(training), None
            features = features_of(self, training.unit, learnt=False)
            if learns:
                features, self.metric_ = learn_metric(self, features, positions)
            settings = self._settings()
            searched = features.for_search(self.n_frames_, settings["max_offset"])
            compared = Compared(searched, positions)
            warn_of_one_feature(self, performances, compared)
            searcher, shared, median = self._search(searched, compared, positions, progress)
            matcher = searcher.at_all_frames(features, self.n_frames_, **settings)
            self.training_.features = features
            self.mu_ = float(features.back(matcher.trellis.mu))
            source = self._set_pattern(training, median, features.degree)
            # Sums over fewer frames, as if over all.
            self.global_distances_ *= self.n_frames_ / (searched.frames or self.n_frames_)
            warper = self._choose_exemplars(training, matcher, source, median.estimates)
            warper = self._decide_on_refinement(training, warper, source, progress, shared)
            self._warper = warper

    def _positions(self, training):
        """Performances of the training set at every sub-position of the clock, in the unit."""
        if self.subframes == 1:
            return training.scaled
        performances = training.performances
        return training.unit.fill(normalise(performances, self.n_frames_, self.subframes))

    def _search(self, features, compared, positions, progress):
        """The matcher that searches, what portions share of the training set, and the median."""
        energy, shape = compared.energy(), features.shape(positions)
        searcher = Matcher.of_energy(features, shape, energy, **self._settings())
        shared = shared_training_set(searcher, positions, compared)
        rounding = rounding_of(compared.like.dtype, energy)
        median = self._choose_median(shared, len(positions), rounding, progress)
        rounds = features.single and positions.dtype != compared.like.dtype
        if not rounds or not median.is_blurred(rounding):
            return searcher, shared, median
        # Trials that are equal but for next to nothing: single precision does not tell them apart.
        features = features.in_full()
        return self._search(features, Compared(features, positions), positions, progress)

    def _choose_median(self, shared, n, rounding, progress):
        """The median (Eq. 19), by all matches or some; without it, what exemplars are chosen by."""
        wanted, population = self._wants_median, self._population
        compare = partial(compare_in_portions, shared, n_jobs=self.n_jobs, progress=progress)
        if not wanted and (self.consensus == 0 or n <= self.consensus):
            # None of them, or all, are exemplars.
            median = Median.unknown(n)
        elif self.search == "exhaustive" or (self.search == "auto" and n <= _EXHAUSTIVE):
            median = sum_all(compare, n, rounding, population)
        elif wanted:
            random_state = check_random_state(self.random_state)
            median = search_median(compare, n, rounding, random_state, population)
        else:
            median = estimate_distances(compare, n, check_random_state(self.random_state))
        known = median if wanted else Median.unknown(n, median.n_matches)
        self.n_matches_, self.certified_ = known.n_matches, known.certified
        self.search_ = Bunch(**known.achieved)
        self.typical_share_ = typical_share(known.in_doubt, n, population) if wanted else np.nan
        return median

    def _choose_exemplars(self, training, matcher, source, estimates):
        """The exemplars, and the warper to the pattern by way of them."""
        self.exemplars_ = np.empty(0, dtype=np.intp)
        if self.consensus > 0:
            self.exemplars_ = choose_exemplars(estimates, self.consensus, self.pattern_index_)
        chosen = [source, *(training.performances[k] for k in self.exemplars_)]
        # In double precision, as all that is warped.
        chosen = [x.astype(np.float64, copy=False) for x in chosen]
        positions = matcher.features.positions(chosen, self.n_frames_)
        pattern = positions[0, :: self.subframes]
        portion = matcher, pattern, positions, self.consensus > 0, self.warp_smoothing
        (warper,) = run(Warper.to_pattern, [portion])
        return warper

    def _decide_on_refinement(self, training, warper, source, progress, shared):
        """Whether warps are refined by postures, and the warper that does so or does not."""
        verdict = Verdict()
        if self.refine == "auto" and self.consensus > 0:
            others = np.flatnonzero(np.arange(len(training.performances)) != self.pattern_index_)
            some = others[:: -(-len(others) // _TRIED) or 1]
            portions = {"n_jobs": self.n_jobs, "progress": progress}
            shown = training.scaled, shared, some
            # Those who are shown some features match without a metric.
            settings = vars(Settings.of(self, learnt=False))
            verdict = try_refinement(warper, source, *shown, settings, **portions)
        names = "ratio", "p_value", "ratio_to_all"
        self.refinement_ = Bunch(**{name: getattr(verdict, name) for name in names})
        self.misfit_ = verdict.misfit
        self.refines_ = bool(verdict.helps if self.refine == "auto" else self.refine)
        if not self.refines_:
            return warper
        return RefinedWarper(**vars(warper), noise_width=choose_smoothing(training.scaled))

    def _settings(self):
        """What a `Matcher` learns with."""
        return vars(Settings.of(self, self.metric_ is not None))
