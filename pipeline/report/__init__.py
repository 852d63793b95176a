"""What people look at: report pages, tables, the drawn graph, plots and progress."""
