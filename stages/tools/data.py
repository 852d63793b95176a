"""Lists the public data sets for which there is a layout."""

from omninav.pipeline import BadInput, Context, Tool, nearest
from omninav.stages.recordings.description import DataSet, known_layouts, read_description


class ListData(Tool):
    """Prints the data sets read without conversion: where to get them, and how to run them.

    Raises BadInput for an unknown name.
    """

    example = "cold"

    name: str = ""
    """One of them, for all about it."""
    layout_folders: tuple[str, ...] = ()
    """Folders with further layouts (`nodes.source.layout_folders`)."""

    def run(self, ctx: Context) -> None:
        known: dict[str, DataSet] = {}
        broken: dict[str, BadInput] = {}
        for name, path in known_layouts(self.layout_folders).items():
            try:
                described = read_description(path, self.layout_folders).about
            except BadInput as error:
                broken[name] = error
            else:
                if described is not None:
                    known[name] = described
        if not self.name:
            lines = [f"{name:<16} {about.what}\n{'':<16} {about.site}" for name, about in known.items()]
            print("\n".join([*lines, *(f"{name:<16} {error}" for name, error in broken.items())]))
        elif self.name in broken:
            raise broken[self.name]
        elif self.name in known:
            about = known[self.name]
            facts = {
                "what": about.what,
                "from": about.site,
                "run": f"omninav {about.run}",
                "published": about.published,
            }
            print("\n".join(f"{name:<10} {value}" for name, value in facts.items() if value))
        else:
            near = nearest(self.name, known)
            hint = f"did you mean '{near}'?" if near else f"there are {', '.join(known)}"
            raise BadInput(f"name={self.name:.60}: no such data set; {hint}")
