"""The Grasp Quality Network and how it is trained.

The network of section III-B of the paper, the trainer that fits it to the GQN inputs of one dataset version, and the
checkpoint, which names the snapshot it was trained on. Nothing here knows how attempts are collected.
"""
