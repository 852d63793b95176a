"""Commands with arguments of their own (`omninav map cut`): a file is named after what is typed."""
