"""A world becomes light, with Mitsuba. The only room that imports mitsuba or drjit."""
