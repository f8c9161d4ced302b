"""Laboratories: what is learned where a table stands, push by push."""
