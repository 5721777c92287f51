from hypothesis import settings

# The first example of a test may compile a kernel; its time says nothing about the code.
settings.register_profile("pumplib", deadline=None, derandomize=True)
settings.load_profile("pumplib")
