"""How fine must the step be? Time and error of four, against the same scene finely sampled."""

import sys

import volviz

scene = volviz.Scene.of(volviz.sample("marschner-lobb"))
found = volviz.compare(scene, {"step": [0.25, 0.5, 1, 2]}, size=(120, 120))
print(found)  # milliseconds, RMSE, largest error, memory, samples
found.save(sys.argv[1] if len(sys.argv) > 1 else "steps.png", difference=True)
