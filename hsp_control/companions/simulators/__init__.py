"""Controllers for users' simulators: robosuite, Gymnasium.

Each module imports its simulator, and is imported only by those who use it.
"""
