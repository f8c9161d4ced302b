"""Sheets to print, as PDF with true sizes."""
