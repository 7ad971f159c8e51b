"""DenseSynchronizer: dense matching to the median performance (Eqs. 7-19)."""

from numbers import Integral, Real

from sklearn.utils import Bunch
from sklearn.utils._param_validation import Interval, StrOptions

from ..fitting import of_one_state
from ..matching.costs import COSTS
from .base import Synchronizer
from .match import Match
from .portions import warp_in_portions
from .steps import DenseSteps

__all__ = ["DenseSynchronizer"]


class DenseSynchronizer(DenseSteps):
    """Synchronise performances by dense matching to the median one.

    1. Normalise all performances linearly to ``P`` frames (Eq. 7).
    2. Learn the metric: which features, and which combinations of them, tell the moments of the
       action in these performances, and which are noise or style (see ``metric``).
    3. Match ordered pairs: dynamic programming finds the offsets Delta(p) that
       minimise the synchronisation distance ``D_{n,m}`` (Eqs. 12-17)::

           sum_p |x_n(p) - x_m(p + Delta(p))|^2 + mu sum_p phi(rate)

       with both ends pinned and the local rate between 0 and ``max_rate``. By default
       velocities and postures in the learnt metric stand in for the points x (see ``cost``).
    4. The pattern has the smallest global distance ``C_n = sum_m D_{n,m}`` (Eq. 19): it is the
       "median" performance, among more than 100 found by a part of all matches (see ``search``).
    5. Consensus: the time of the pattern reaches a performance straight, or by way of
       one of ``consensus`` exemplars, typical performances of the training set; the median
       of these routes, weighted by how alike the performances along them are, outvotes a path
       that took a wrong valley. It is then smoothed.
    6. Refinement: if it helps, as it does for repeated trials of a single source, whose postures
       agree but for noise and gain, Gauss-Newton steps place every moment to a fraction of a frame.
    7. ``transform`` samples performances at ``tau(p) = p + Delta(p)`` (Eq. 18).

    Most data need nothing turned. Three parameters, among the first, are worth a thought:
    ``n_frames``, the resolution of the clock; ``refine=True``, if all are trials of a single
    source; ``max_offset``, how far apart they can be. ``pattern`` keeps a clock that is there
    already. The seven from ``metric`` to ``subframes`` are there for the record: they were measured
    and set, and make it the paper's exact method,
    ``DenseSynchronizer(cost="posture", max_rate=2, subframes=1, consensus=0)``. The
    last four are for many performances and long jobs.

    Parameters
    ----------
    n_frames : int, default=None
        ``P``, frames of the common clock; by default the median length of the performances,
        or the length of a pattern given as an array. Time grows with its square, as
        ``max_offset`` is a share of it.
    pattern : "median", int or array (n_frames, n_features), default="median"
        The median performance, one chosen by its index, or another one.
    velocity_smoothing : "auto" or float, default="auto"
        Standard deviation of the Gaussian under which velocities are taken, as a share of the
        clip, so that it does not depend on the frame rate; beyond its ends a clip is
        continued by its point reflection. ``"auto"``: 0.02 with a learnt metric, which knows what
        is noise, and 0.03 without.
    refine : "auto" or bool, default="auto"
        Whether to refine warps by the postures. ``"auto"`` does so if there is a vote and it
        helps: on features of the training set that had no part in it (see ``refinement_``).
        A single feature, or several that say the same, cannot tell.
    max_offset : "auto" or float, default="auto"
        Largest offset, as a share of ``n_frames``, in [0, 1]. ``"auto"``: 0.4 with a learnt
        metric, 0.25 without, where a wider band leads paths astray.
    metric : "learned" or None, default="learned"
        What the velocity cost compares. ``"learned"``: velocities, compressed, and postures less
        their own mean, weighted by how well they agree at the same moment; learnt in ``fit`` from
        3 to 20 performances, and off without a vote (``consensus=0``). Distances are then pure
        numbers. None: velocities, all directions alike. Other costs are compared as they are.
    consensus : int, default=8
        How many exemplars vote on a warp; 0 for the direct path only, as in the paper, which
        is then neither smoothed nor, unless ``refine=True``, refined.
    warp_smoothing : float, default=0.02
        Standard deviation of the Gaussian under which the offsets are smoothed after the
        vote, as a share of the clip. More makes smoother synchronised movements and hits
        key moments less closely.
    cost : {"velocity", "elastic", "posture"}, default="velocity"
        What is compared. ``"velocity"``: how the point moves; at the local rate rho,
        ``v_n`` with ``(0.8 + 0.2 rho) v_m``. ``"elastic"``: its velocity
        divided by the square root of its speed, with weights that make the distance (of
        Fisher and Rao) independent of how either sequence is timed. ``"posture"``: where the
        point is, as in the paper.
    smoothness : float, default=0.003
        Weight of the changes of pace, a pure number: ``mu`` is ``smoothness`` times the
        mean squared norm of the compared features over the training set.
    max_rate : float, default=4
        Largest local rate of a path; 2 is the limit of Eq. 13. The vote and the refinement
        may exceed it.
    subframes : int, default=1
        Positions a frame at which a path may stand. More than 1 serves direct paths
        (``consensus=0``); the vote, its smoothing and the refinement are finer anyway.
    search : {"auto", "exhaustive", "sampled"}, default="auto"
        How the median is found: by all matches, or by those with random references, as few as it
        takes to be sure (see ``search_``). ``"auto"``: by all up to 100 performances.
    max_fit : int, default=None
        Of how many performances, at least 2 and drawn at random, ``fit`` learns everything: clock,
        metric, pattern, exemplars, whether to refine. The others are not looked at, nor read if
        ``X`` gives performances by index: a fit takes the same time and memory however many there
        are. A pattern that is told by its index is among them. None: of all. See
        ``typical_share_``.
    random_state : int, RandomState instance or None, default=0
        Draws the references of a sampled search, and who is learnt from. The default makes equal
        input give equal results.
    n_jobs : int, default=None
        How many jobs share the matches, in ``fit``, ``transform`` and ``match``. None means 1
        unless in a ``joblib.parallel_config`` context, -1 all cores. Results are the same to the
        last bit.
    verbose : int, default=0
        Above 0, print how far a long job is, at most once a second.

    Attributes
    ----------
    pattern_ : ndarray, shape (P, n_features)
        The pattern on the common clock.
    pattern_index_ : int or None
        Its index in the training set; None if it was given as an array.
    n_frames_ : int
        ``P``.
    global_distances_ : ndarray, shape (n_sequences,)
        ``C_n`` of Eq. 19 of those who met all: of every performance after an exhaustive search, of
        the best few after a sampled one; NaN for the others, and if nobody needed them. With a
        learnt metric the search compares, where ``P`` is 1.5 times as many or more, at as many
        frames as the smoothing of velocities leaves independent (51 by default; more for a
        narrow band), in single precision if that tells the typical ones apart, or the data have
        no other; sums are scaled to ``P``. Sums of the ``distances`` of `match`, at all frames, are
        within 12 % of them on ten actions of people, and smallest for the same performance; the
        precision makes 2e-7.
    certified_ : bool
        Whether the pattern is the median of Eq. 19, as the search compares: known from all matches,
        or because paired tests, which err with a probability of 1 % all together, rejected every
        other performance. False if the pattern was given, or a search has spent its 150 matches a
        performance. After a fit to a sample: whether nobody else of the sample may be more typical
        of all.
    n_matches_ : int
        Matches by which the pattern and the exemplars were chosen.
    search_ : Bunch
        ``n_matches``, ``certified``, as above; ``in_doubt``, how many others no test rejected;
        ``excess``: with a probability of 99 % the pattern's ``C_n`` is at most ``1 + excess``
        times the smallest. All are in doubt, the excess is NaN, if the pattern was given.
    sample_ : ndarray of int
        Indices of the performances that were learnt from: all, or ``max_fit`` of them.
        ``global_distances_`` are those to these, NaN for all others; ``training_`` is of these.
    typical_share_ : float
        At most this share of all performances is more typical than the pattern: has a smaller
        global distance. 0 if that is the certified median of all. After a fit to a sample it holds
        with a probability of 95 % (beside the 1 % of the search), if the sample stands for all:
        with 500 that leave no doubt it is 0.006. Distances are those of this fit, in the metric
        of the sample. NaN if the pattern was given.
    metric_ : Bunch or None
        What was learnt: ``share``, the part of every feature in what is compared, about 0 for
        noise; ``energy``, its part in the plain velocities, which would be compared without a
        metric, above 0.95 of one of several a warning; ``performances``, the indices of those it
        was learnt from. It is learnt in single precision. None if none was learnt.
    mu_ : float
        The absolute weight of the changes of pace, by the frames that the search compares: within
        1 % of that by all.
    exemplars_ : ndarray of int
        Indices of the performances that vote.
    misfit_ : float
        Median share of the pattern's variance that matched postures leave, smoothed so that
        noise hardly counts; NaN unless ``refine="auto"`` finds that refining may help.
    refinement_ : Bunch
        What was found out by ``refine="auto"``, on features that had no part in the warps:
        ``ratio``, their misfit after refining by the other features to that after matching by the
        others alone; ``p_value``, of a t test that refining does not help; both after a first
        look if that leaves no hope; ``ratio_to_all``, to the misfit after matching by all features,
        if that is still asked. NaN where nothing tells.
    refines_ : bool
        Whether warps are refined.
    training_ : Bunch
        What `find_performances` goes by, as of `Synchronizer`.
    n_features_in_ : int
        Features of a frame (columns, for 2-D input).
    feature_names_in_ : ndarray of str
        Names of the features; only if the input had names.

    See Also
    --------
    LinearSynchronizer : The baseline without matching.
    KeyframeSynchronizer : Matching by key-frames.
    ActionModel : What the synchronised performances have in common.
    MetricDisplay : Draws what the metric listens to, and what it takes for noise.

    References
    ----------
    M. Mozerov, I. Rius, X. Roca, J. Gonzalez, "3D Human Motion Sequences Synchronization
    Using Dense Matching Algorithm".

    Examples
    --------
    A known warp is found again. The second performance is up to 8 frames ahead in its first
    half, and behind in its second.

    >>> import numpy as np
    >>> from sklearn_motionsync import DenseSynchronizer
    >>> t = np.linspace(0, 1, 101)
    >>> phase = t + 0.08 * np.sin(2 * np.pi * t)
    >>> def movement(phase):
    ...     return np.column_stack([np.cos(4 * phase), np.sin(4 * phase)])
    >>> X = [movement(t), movement(phase)]
    >>> sync = DenseSynchronizer(pattern=0).fit(X)
    >>> truth = 100 * (np.interp(t, phase, t) - t)
    >>> float(np.abs(sync.match(X).offsets[1] - truth).mean().round(1))
    0.0
    >>> sync.transform(X).shape
    (2, 101, 2)
    """

    _parameter_constraints: dict = {
        **Synchronizer._parameter_constraints,
        "velocity_smoothing": [StrOptions({"auto"}), Interval(Real, 0, 1, closed="both")],
        "refine": [StrOptions({"auto"}), "boolean"],
        "max_offset": [StrOptions({"auto"}), Interval(Real, 0, 1, closed="both")],
        "metric": [StrOptions({"learned"}), None],
        "consensus": [Interval(Integral, 0, None, closed="left")],
        "warp_smoothing": [Interval(Real, 0, 1, closed="both")],
        "cost": [StrOptions(set(COSTS))],
        "smoothness": [Interval(Real, 0, None, closed="left")],
        "max_rate": [Interval(Real, 1, None, closed="left")],
        "subframes": [Interval(Integral, 1, None, closed="left")],
        "search": [StrOptions({"auto", "exhaustive", "sampled"})],
        "max_fit": [Interval(Integral, 2, None, closed="left"), None],
        "random_state": ["random_state"],
        "n_jobs": [Integral, None],
        "verbose": ["verbose"],
    }

    def __init__(
        self,
        n_frames=None,
        pattern="median",
        *,
        velocity_smoothing="auto",
        refine="auto",
        max_offset="auto",
        metric="learned",
        consensus=8,
        warp_smoothing=0.02,
        cost="velocity",
        smoothness=0.003,
        max_rate=4,
        subframes=1,
        search="auto",
        max_fit=None,
        random_state=0,
        n_jobs=None,
        verbose=0,
    ):
        self.n_frames = n_frames
        self.pattern = pattern
        self.velocity_smoothing = velocity_smoothing
        self.refine = refine
        self.max_offset = max_offset
        self.metric = metric
        self.consensus = consensus
        self.warp_smoothing = warp_smoothing
        self.cost = cost
        self.smoothness = smoothness
        self.max_rate = max_rate
        self.subframes = subframes
        self.search = search
        self.max_fit = max_fit
        self.random_state = random_state
        self.n_jobs = n_jobs
        self.verbose = verbose

    @of_one_state
    def match(self, X):
        return self._match_in_parts(X)

    def _match(self, performances):
        warper = self._warper
        self._check_unit(performances)
        with self._progress(fits=False) as progress:
            portions = {"n_jobs": self.n_jobs, "progress": progress, "name": "warping"}
            distances, times = warp_in_portions(warper, performances, **portions)
        return Match(times, warper.matcher.features.back(distances))

    @of_one_state
    def disparity_space(self, X, performance=0):
        """The disparity space of the pattern and one performance, and the path through it (Fig. 2).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        performance : int, default=0
            Which of them.

        Returns
        -------
        Bunch
            ``frames`` p and ``offsets`` d, all of them or, of long takes, evenly spaced ones;
            ``costs`` E(p, d) of Eq. 12 at the pattern's rate, shape (n_frames, n_offsets), NaN
            where no path that obeys Eqs. 9 and 13 can pass; ``path``, the offsets of the best
            path, shape (P,), before vote, smoothing and refinement.

        Raises
        ------
        ValueError
            If there is no such performance.
        """
        performances = self.check_performances(X)
        whole = isinstance(performance, Integral) and not isinstance(performance, bool)
        if not whole or not 0 <= performance < len(performances):
            raise ValueError(
                f"performance={performance} is out of range: there are {len(performances)} "
                f"performances, 0 to {len(performances) - 1}."
            )
        warper = self._warper
        positions = warper.positions([performances[performance]])
        frames, offsets, costs, path = warper.disparity_space(positions)
        costs = warper.matcher.features.back(costs)
        return Bunch(frames=frames, offsets=offsets, costs=costs, path=path)
