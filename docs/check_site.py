"""Check a built site: every link, fragment and picture, and that nothing is fetched to show it.

    python docs/check_site.py docs/_build/html [--base URL]

Links that begin with the address of the site itself, ``--base``, such as those in the diagrams of
estimators, are looked up like the others. ``--external`` lists links to other sites; they are
not followed.
"""

import argparse
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What a browser fetches by itself to show a page, and by which attribute.
FETCHED = {
    "audio": "src",
    "embed": "src",
    "iframe": "src",
    "img": "src",
    "input": "src",
    "object": "data",
    "script": "src",
    "source": "src",
    "track": "src",
    "video": "src",
}
# <link rel=...> that is fetched; others (canonical, next, search) only name a page.
FETCHED_LINKS = {"stylesheet", "icon", "preload", "modulepreload", "prefetch", "manifest"}
CSS_URL = re.compile(r"""(?:url\(|@import\s+)\s*["']?([^"')\s]+)""")


class Page(HTMLParser):
    """Links, fetched files and ids of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.fetched, self.ids = [], [], []
        self._style = False
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attributes):
        attributes = {name: value or "" for name, value in attributes}
        self.ids += [attributes[name] for name in ("id", "name") if attributes.get(name)]
        self._style = tag == "style"
        if tag in ("a", "area") and "href" in attributes:
            self.links.append(attributes["href"])
        if tag == "link" and "href" in attributes:
            fetched = FETCHED_LINKS & set(attributes.get("rel", "").lower().split())
            (self.fetched if fetched else self.links).append(attributes["href"])
        if attributes.get(FETCHED.get(tag)):
            self.fetched.append(attributes[FETCHED[tag]])
        for source in attributes.get("srcset", "").split(","):
            self.fetched += source.split()[:1]
        self.fetched += CSS_URL.findall(attributes.get("style", ""))

    def handle_data(self, data):
        if self._style:
            self.fetched += CSS_URL.findall(data)


class Site:
    """The pages of a folder, and what is wrong with them."""

    def __init__(self, root, base=None):
        self.root, self.base = root.resolve(), base and base.rstrip("/")
        # Themes keep patterns of their own in _static: they are no pages.
        pages = [p for p in self.root.rglob("*.html") if "_static" not in p.parts]
        self.pages = {path.resolve(): Page(path) for path in sorted(pages)}
        self.count, self.problems, self.external = 0, [], set()

    def check(self):
        for path, page in self.pages.items():
            for target in page.links:
                self._check(path, target, fetched=False)
            for target in page.fetched:
                self._check(path, target, fetched=True)
        for path in sorted(self.root.rglob("*.css")):
            for target in CSS_URL.findall(path.read_text(encoding="utf-8")):
                self._check(path, target, fetched=True)

    def _check(self, path, target, *, fetched):
        where = path.relative_to(self.root)
        if self.base and target.startswith(self.base + "/"):
            target = target.removeprefix(self.base)
        parts = urlsplit(target)
        if parts.scheme in ("data", "javascript", "mailto"):
            return
        self.count += 1
        if parts.scheme or parts.netloc:
            if fetched:
                self.problems.append(f"{where}: fetched from another site: {target}")
            else:
                self.external.add(target)
            return
        file = path
        if parts.path:
            start = self.root if parts.path.startswith("/") else path.parent
            file = (start / unquote(parts.path).lstrip("/")).resolve()
            if file.is_dir():
                file /= "index.html"
        if not file.is_file():
            self.problems.append(f"{where}: no such file: {target}")
        elif fetched and file.stat().st_size == 0 and file.suffix not in (".js", ".css"):
            self.problems.append(f"{where}: empty file: {target}")
        elif parts.fragment and not fetched and file in self.pages:
            # "#" and "#top" are the top of any page; a colon begins a text fragment.
            fragment = unquote(parts.fragment)
            known = fragment in self.pages[file].ids or fragment == "top"
            if not known and not fragment.startswith(":~:"):
                self.problems.append(f"{where}: no such id: {target}")


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Check the links and pictures of a built site.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--base", help="address of the site itself")
    parser.add_argument("--external", action="store_true", help="list links to other sites")
    options = parser.parse_args(arguments)
    site = Site(options.folder, options.base)
    if not site.pages:
        print(f"There are no HTML pages in {options.folder}.")
        return 1
    site.check()
    if options.external:
        print("\n".join(sorted(site.external)))
    for problem in site.problems:
        print(problem)
    print(f"{len(site.pages)} pages, {site.count} links and files, {len(site.problems)} problems")
    return 1 if site.problems else 0


if __name__ == "__main__":
    sys.exit(main())
