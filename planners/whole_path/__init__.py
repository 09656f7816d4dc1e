"""Planners of whole paths: a router finds a route, and segments are fitted to it.

`planner.WholePath` does so for any router: `exact.ShortestPathRouter`, `voronoi.VoronoiEdges`,
`astar.AStar`, `ompl.Ompl` and `swarm.Swarms`. `polish.polish` shortens a whole flight. Nothing is
imported here, because the process in which OMPL runs starts in this folder and needs no optimiser.
"""
