"""Grasp attempts and how they come about.

A station, simulated or real, performs one attempt at a time behind the ``Station`` protocol, in which every phase may
fail or be stopped and says so. The collector asks a station for attempts and hands them to the dataset writer; it
neither knows nor cares which station it has.
"""
