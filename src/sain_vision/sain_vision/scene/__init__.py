"""From poses of bodies to scenes: rest, jumps, ids. No middleware here."""
