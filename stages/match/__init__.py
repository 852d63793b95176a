"""How similar the present view and the views of the map are."""
