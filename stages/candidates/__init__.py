"""Which views of the map are compared with the present one."""
