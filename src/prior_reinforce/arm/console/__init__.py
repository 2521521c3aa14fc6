"""The operator's console: a page over a workspace, for whoever stands beside the arm."""
