"""Windows and doors in a wall that stands in y = 0 with its outside at -y."""

from .solids import Part, along_y, arch, box, raised


def window(width, height, columns, rows, lintel=False, sill=True, round_top=False, depth=0.12):
    """Middle of the lower side at the origin."""
    part = Part()
    half, rim = width / 2, 0.06
    outline = (
        arch(-half, half, height)
        if round_top
        else [(-half, 0), (half, 0), (half, height), (-half, height)]
    )
    inner = (
        [(x * (1 - rim / half), z) for x, z in arch(-half, half, height - rim)]
        if round_top
        else None
    )
    part.cut(along_y(outline, -0.2, depth + 0.06))
    hole = (
        along_y(raised(inner, rim), -1, 1)
        if round_top
        else box([-half + rim, -1, rim], [half - rim, 1, height - rim])
    )
    part.add(along_y(outline, depth - 0.03, depth + 0.08) - hole, "white paint")
    part.add(along_y(outline, depth + 0.03, depth + 0.09), "glass")
    for column in range(1, columns):
        x = -half + width * column / columns
        part.add(box([x - 0.02, depth, 0], [x + 0.02, depth + 0.08, height]), "white paint")
    for row in range(1, rows):
        z = height * row / rows
        part.add(box([-half, depth, z - 0.02], [half, depth + 0.08, z + 0.02]), "white paint")
    if round_top:
        part.add(
            box([-half, depth - 0.02, height - 0.03], [half, depth + 0.08, height + 0.03]),
            "white paint",
        )
    if sill:
        part.add(box([-half - 0.08, -0.09, -0.08], [half + 0.08, 0.05, 0]), "stone")
    if lintel and not round_top:
        part.add(box([-half - 0.15, -0.03, height], [half + 0.15, 0.05, height + 0.22]), "stone")
    return part


def door(random, width=1.0, height=2.1):
    part = Part()
    half = width / 2
    part.cut(box([-half, -0.2, 0], [half, 0.2, height]))
    part.add(box([-half, 0.08, 0], [half, 0.25, height]), "paint")
    panels = int(random.integers(1, 4))
    for panel in range(panels):
        low = 0.2 + panel * (height - 0.3) / panels
        part.add(
            box(
                [-half + 0.15, 0.055, low], [half - 0.15, 0.1, low + (height - 0.3) / panels - 0.15]
            ),
            "paint",
        )
    part.add(box([-half - 0.1, -0.04, 0], [-half, 0.1, height + 0.1]), "white paint")
    part.add(box([half, -0.04, 0], [half + 0.1, 0.1, height + 0.1]), "white paint")
    part.add(box([-half, -0.04, height], [half, 0.1, height + 0.1]), "white paint")
    return part
