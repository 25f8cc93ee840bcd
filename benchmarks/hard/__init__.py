"""Hard scenes: a seeded generator of them, the laws that every motion obeys, and the results of each method on them."""
