"""Points of the world that several images see: found, triangulated, adjusted with the poses, and seen again."""
