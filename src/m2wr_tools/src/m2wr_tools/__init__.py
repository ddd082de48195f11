"""Commands that work on results of several packages: nothing below imports this package."""
