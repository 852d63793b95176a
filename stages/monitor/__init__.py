"""Watches a localisation from outside: how far it is to be trusted."""
