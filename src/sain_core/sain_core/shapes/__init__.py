"""The shapes of bodies: one file a shape, found by name. Imports `scene`, `types` and `errors`."""
