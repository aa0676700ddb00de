#!/usr/bin/env python3
"""Mirrors what a mandrel and a probe said of the gantry's spindle: its nose stands off and leans,
and it grows towards the part as its box warms up. Says where the tool is believed to be; abbe finds
the correction."""
import json
import sys

NOSE = (0.003, -0.002, 0.005)  # mm that the nose stands off, in X Y Z of the tool
LEAN = (12e-6, -15e-6)  # rad that it leans about X and Y
GROWTH = -0.0013  # mm/K of the spindle box, along Z
REFERENCE = 20.0  # degrees C


def say(message):
    print(json.dumps(message), flush=True)


def hear():
    return json.loads(sys.stdin.readline())


def deviation(readings):
    grown = GROWTH * (readings[box] - REFERENCE) if box is not None else 0.0
    x, y, z = NOSE
    return [x - LEAN[1] * length, y + LEAN[0] * length, z + grown, LEAN[0], LEAN[1], 0.0]


task = hear()
length = task["tool"]["length"]
box = next((i for i, name in enumerate(task["readings"]) if "spindle_box" in name), None)
say({"abbe": 1, "kind": "ready", "name": "mirror of the spindle", "answers": "deviation"})
while (ask := hear())["kind"] == "ask":
    say({"id": ask["id"], "deviation": [deviation(readings) for readings in ask["readings"]]})
