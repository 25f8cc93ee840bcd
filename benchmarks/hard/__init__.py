"""Hard scenes: a seeded generator of them, the laws that every motion keeps, and what each method does on them."""
