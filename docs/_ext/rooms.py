"""Names without their room: a docstring of one room may name an object of another."""

from sphinx.util.nodes import make_refnode


def resolve(app, env, node, contnode):
    """The one object of the package that has this name, in whatever room it is."""
    if node.get("refdomain") != "py":
        return None
    objects, target = env.get_domain("py").objects, node["reftarget"]
    names = [
        name
        for name, entry in objects.items()
        if name.startswith("sklearn_motionsync.") and name.endswith(f".{target}")
        if not entry.aliased
    ]
    if len(names) != 1:
        return None
    entry = objects[names[0]]
    return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, contnode, target)


def setup(app):
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True}
