"""The commands of ``python -m nsm_core``: arguments read, one function called, results printed."""
