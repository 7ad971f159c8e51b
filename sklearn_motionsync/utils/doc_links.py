"""What estimators show in a notebook: diagrams that link to their page of the manual."""

__all__ = ["DOCUMENTATION", "DocumentedMixin"]

DOCUMENTATION = "https://sklearn-motionsync.readthedocs.io/en/latest"


class DocumentedMixin:
    """Links scikit-learn's diagram of an estimator to its page of this package's manual."""

    _doc_link_module = "sklearn_motionsync"
    _doc_link_template = DOCUMENTATION + "/reference/sklearn_motionsync.{estimator_name}.html"
