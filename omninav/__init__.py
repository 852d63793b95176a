"""omninav: localisation, mapping and navigation with an omnidirectional camera, as typed stages in a dataflow graph."""
