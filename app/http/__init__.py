"""HTTP itself: access, forms of an answer, what is wrong with a request, and what passes through with each."""
