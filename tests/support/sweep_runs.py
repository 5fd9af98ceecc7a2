"""Small sweeps, the commands that start them, and whether two are the same."""

MOVING = "paper/4_moving_obstacle"
QUICK = ["simulation.duration=0.1", "simulation.integrator={type: rk4, step: 0.005}"]
OVER = {
    "null_space.gain": "log:1:100:3",
    "start.coordinates.0": "1.0:1.6:2",
    "scene.obstacles.disk.shape.radius": [0.1, 0.3],
}
