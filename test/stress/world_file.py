"""Lines of world files for plumbline_simulate, and scripts that write several."""

import os
import sys


def wall(a, b, thickness=0.12):
    return "wall %.4f %.4f %.4f %.4f %.2f" % (*a, *b, thickness)


def rectangle(x, y, width, height):
    """Four walls around a corner with the least x and y, m."""
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height),
               (x, y)]
    return [wall(a, b) for a, b in zip(corners, corners[1:])]


def path(points):
    return "path " + " ".join("%.3f %.3f" % point for point in points)


def write_worlds(worlds, usage):
    """Writes the lines that each function gives to a file of its name in the
    folder that is the only argument of the script."""
    if len(sys.argv) != 2:
        sys.exit(usage)
    for world in worlds:
        with open(os.path.join(sys.argv[1], world.__name__ + ".world"),
                  "w") as file:
            file.write("\n".join(world()) + "\n")
