"""Layout of the HTML reports (Jinja2 templates, style, script)."""
