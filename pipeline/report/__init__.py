"""Report pages, tables, the drawn graph, plots and progress."""
