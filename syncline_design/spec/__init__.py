"""What the user wrote: YAML with places, catalogs, the spec and edits of it."""
