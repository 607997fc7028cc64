"""What a trained network is worth on a station.

Trials of each servo method on objects that training never saw, and the table of their success rates with confidence
intervals. A station is known through its protocol alone, so that simulator and rig are evaluated by the same code.
"""
