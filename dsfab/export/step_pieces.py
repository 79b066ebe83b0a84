"""The end of a STEP file: shells, solids, and for each piece a product with its name and a colour."""

from collections.abc import Iterator

from dsfab.arrays import Ints
from dsfab.export.text import one_line

COLOURS = ((0.62, 0.66, 0.70), (0.80, 0.62, 0.42), (0.45, 0.62, 0.72), (0.60, 0.70, 0.50), (0.72, 0.55, 0.60))
"""Red, green and blue of the pieces, in turns: muted, so that edges stay visible."""


def piece_name(name: str, i: int, pieces: int) -> str:
    """`dome` when it is alone, `dome 1`, `dome 2` ... when there are more."""
    return one_line(name) if pieces == 1 else f"{one_line(name)} {i + 1}"


def closing(shell: Ints, solids: list[list[int]], faces: Ints, free: int, name: str) -> Iterator[str]:
    """Solids, products, colours and the end of the file, in numbers from `free` on.

    shell : (f,) the shell of each face, whose entity is faces[i]. solids : the shells of each, the outer one first.
    The product of the first piece is in the header; every other one gets its own.
    """
    new = Numbered(free)
    styles = [_style(new, colour) for colour in COLOURS[: len(solids)]]
    styled = []
    for i, (outer, *voids) in enumerate(solids):
        item = _solid(new, faces, shell, outer, voids)
        shape = new.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',(#18,#{item}),#14)")
        definition = 8 if i == 0 else product(new, piece_name(name, i, len(solids)))
        new.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{shape})")
        styled.append(new.add(f"STYLED_ITEM('',(#{styles[i % len(styles)]}),#{item})"))
    listed = ",".join(f"#{k}" for k in styled)
    new.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({listed}),#14)")
    yield from new.text
    yield "ENDSEC;\nEND-ISO-10303-21;\n"


class Numbered:
    """Entities with the numbers that follow `free`."""

    def __init__(self, free: int) -> None:
        self.free, self.text = free, list[str]()

    def next(self) -> int:
        """The number of an entity whose text is written elsewhere."""
        self.free += 1
        return self.free - 1

    def add(self, body: str) -> int:
        """The number of a new entity."""
        self.text.append(f"#{self.free}={body};\n")
        return self.next()


def product(new: Numbered, name: str) -> int:
    """A product with the contexts of the header; returns its PRODUCT_DEFINITION_SHAPE."""
    title = quoted(name)
    made = new.add(f"PRODUCT('{title}','{title}','',(#3))")
    formation = new.add(f"PRODUCT_DEFINITION_FORMATION('','',#{made})")
    definition = new.add(f"PRODUCT_DEFINITION('design','',#{formation},#6)")
    new.add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{made}))")
    return new.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")


def _style(new: Numbered, colour: tuple[float, float, float]) -> int:
    """The presentation style of a surface colour."""
    at = new.add(f"COLOUR_RGB('',{','.join(f'{x:g}' for x in colour)})")
    for body in (
        "FILL_AREA_STYLE_COLOUR('',#%d)",
        "FILL_AREA_STYLE('',(#%d))",
        "SURFACE_STYLE_FILL_AREA(#%d)",
        "SURFACE_SIDE_STYLE('',(#%d))",
        "SURFACE_STYLE_USAGE(.BOTH.,#%d)",
        "PRESENTATION_STYLE_ASSIGNMENT((#%d))",
    ):
        at = new.add(body % at)
    return at


def _solid(new: Numbered, faces: Ints, shell: Ints, outer: int, voids: list[int]) -> int:
    """The solid inside one shell and outside others, which are written facing outwards and reversed here."""
    shells = [
        new.add(f"CLOSED_SHELL('',({','.join(f'#{k}' for k in faces[shell == i].tolist())}))") for i in [outer, *voids]
    ]
    inner = [new.add(f"ORIENTED_CLOSED_SHELL('',*,#{k},.F.)") for k in shells[1:]]
    if not inner:
        return new.add(f"MANIFOLD_SOLID_BREP('',#{shells[0]})")
    return new.add(f"BREP_WITH_VOIDS('',#{shells[0]},({','.join(f'#{k}' for k in inner)}))")


def quoted(name: str) -> str:
    """The inside of a STEP string: quotes doubled, and what is not ASCII in hexadecimal (ISO 10303-21, 6.4.3)."""
    name = name.replace("\\", "\\\\").replace("'", "''")
    return "".join(c if c.isascii() else f"\\X4\\{ord(c):08X}\\X0\\" for c in name)
