"""What estimators show in a notebook: diagrams that link to their page of the manual."""

DOCUMENTATION = "https://sklearn-motionsync.readthedocs.io/en/latest"
# Rooms whose estimators have their page under the name of the room; those of others are at the top.
_NAMED_ROOMS = {"live", "takes"}


class DocumentedMixin:
    """Links scikit-learn's diagram of an estimator to its page of this package's manual."""

    _doc_link_module = "sklearn_motionsync"
    _doc_link_template = DOCUMENTATION + "/reference/{estimator_path}.html"

    def _doc_link_url_param_generator(self):
        package, room, *_ = type(self).__module__.split(".")
        path = [package, room] if room in _NAMED_ROOMS else [package]
        return {"estimator_path": ".".join([*path, type(self).__name__])}
