"""Reports and output formats: layout and escaping only, no physics.

Nothing heavy is imported here: jinja2 and matplotlib load when an HTML page is asked for.
"""
