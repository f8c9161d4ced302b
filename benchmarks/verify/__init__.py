"""The figures of the pages, measured again on new samples; see `__main__`."""
