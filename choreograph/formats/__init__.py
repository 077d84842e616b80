"""Readers and writers of every format and of the layouts of data sets; `register` lists them."""
