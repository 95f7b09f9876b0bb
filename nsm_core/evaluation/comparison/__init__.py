"""The networks of the field and the parts of the method, each trained anew and judged by the same trials."""
