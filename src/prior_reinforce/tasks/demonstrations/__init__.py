"""The shipped prior sets, and the modules that regenerate them."""
