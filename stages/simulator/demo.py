"""The built-in world: a small home store, 12 x 9 m, the same as `conf/world/home_store_demo.yaml`."""

from .config import Block, LampGrid, Route, Shelf, WallPanel, WorldConfig


def _shelves() -> tuple[Shelf, ...]:
    return (
        Shelf(centre=(3.7, 2.9), length=3.2, depth=1.0),
        Shelf(centre=(7.7, 2.9), length=2.8, depth=1.0, height=1.5, levels=3),
        Shelf(centre=(3.5, 6.1), length=2.8, depth=1.0, height=1.5, levels=3),
        Shelf(centre=(7.5, 6.1), length=3.2, depth=1.0),
        Shelf(centre=(5.6, 8.8), length=4.8, depth=0.4, height=2.2, levels=5, stock=False),
    )


def _blocks() -> tuple[Block, ...]:
    return (
        Block(centre=(10.6, 3.0), size=(0.4, 0.4), height=3.2, material="concrete"),
        Block(centre=(10.6, 6.1), size=(0.4, 0.4), height=3.2, material="stripes"),
        Block(centre=(11.4, 1.6), size=(0.6, 1.8), height=1.0, material="counter"),
        Block(centre=(0.45, 6.6), size=(0.6, 1.2), height=0.8, material="wood"),
        Block(centre=(11.3, 7.9), size=(0.9, 0.9), height=0.55, material="carton", yaw=0.35),
        Block(centre=(1.2, 4.5), size=(1.4, 1.4), height=0.01, top="mat"),
    )


def _wall_panels() -> tuple[WallPanel, ...]:
    east, north, west, south = 0.0, 1.5707963267948966, 3.141592653589793, -1.5707963267948966
    return (
        WallPanel((0.0, 1.9), east, 1.0, 0.0, 2.1, "door"),
        WallPanel((0.0, 4.2), east, 1.2, 1.0, 1.0),
        WallPanel((0.0, 8.0), east, 0.8, 1.1, 1.1),
        WallPanel((1.6, 0.0), north, 1.0, 1.0, 1.2),
        WallPanel((3.6, 0.0), north, 1.4, 1.1, 0.9),
        WallPanel((5.4, 0.0), north, 0.8, 0.9, 1.3),
        WallPanel((7.6, 0.0), north, 1.6, 0.8, 1.4, "window"),
        WallPanel((9.9, 0.0), north, 1.0, 0.0, 2.1, "door"),
        WallPanel((12.0, 3.6), west, 1.2, 1.1, 1.2),
        WallPanel((12.0, 5.6), west, 1.8, 0.0, 2.2, "door"),
        WallPanel((1.4, 9.0), south, 1.0, 1.0, 1.3),
        WallPanel((9.4, 9.0), south, 1.4, 0.9, 1.2, "window"),
        WallPanel((10.9, 9.0), south, 0.7, 1.2, 1.0),
    )


def _routes() -> dict[str, Route]:
    return {
        "tour": Route(
            waypoints=(
                (1.2, 1.2),
                (9.4, 1.2),
                (9.75, 4.0),
                (9.2, 4.5),
                (1.5, 4.5),
                (1.25, 5.2),
                (1.4, 7.2),
                (2.0, 7.6),
                (9.0, 7.6),
                (9.75, 6.8),
                (9.5, 4.9),
            )
        ),
        "drive": Route(
            waypoints=((2.4, 1.5), (9.0, 1.5), (9.7, 2.4), (9.75, 6.6), (9.0, 7.3), (2.2, 7.3), (1.5, 6.4), (1.7, 5.0))
        ),
    }


DEMO = WorldConfig(
    name="home_store_demo",
    shelves=_shelves(),
    blocks=_blocks(),
    wall_panels=_wall_panels(),
    lamp_grid=LampGrid(),
    routes=_routes(),
)
"""The world that is used when none is named."""
