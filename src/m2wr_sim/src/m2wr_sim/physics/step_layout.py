# SPDX-License-Identifier: BSD-3-Clause
"""Layout of the block of memory of the compiled loop; nothing is compiled here.

All data for the callback is in one block of 8-byte words, which are read both as unsigned integers and as floats:

====================  =======================================================================================
words                 content
====================  =======================================================================================
0 .. 63               header, see the ``H_`` names; sections are given by their first word
H_CONTACTS            dContact structures of ``CONTACT_WORDS`` words: those of this step, at most ``H_KEPT_ROOM``, and
                      room for ``MAX_FOUND`` new ones
H_GRIPS               ``GRIP_WORDS`` words for each of the former: joint, its bodies, mu, mu2, address of its
                      dJointFeedback, normal force that its limits are taken from (below 0: not known), a movable model
                      in it, that model's island (a row of H_ISLANDS), whether it is coupled, which contact it is, room
                      for a dJointFeedback
H_FORMER              ``FORMER_WORDS`` words a contact of the last coupled step, H_FORMER_STEP: which, normal force
H_STATES              ``STATE_WORDS`` words a body: position, orientation, velocities, force and torque before the step;
                      whether it is disabled while others are solved again
H_IDLERS              ``IDLE_WORDS`` words a body that may sleep: body, steps and time left until it sleeps
H_PAIRS               class by class table of ``PAIR_WORDS`` words: the surface of a pair, see the ``P_`` names
H_GEOMS               ``GEOM_WORDS`` words a geom: class, body, link (from 1 on; 0 where it never meets its own model),
                      whether its contacts are watched, movable model (counted in H_SPACES; 0 also where static),
                      whether it moves and never sleeps, number of its body in H_IDLERS (from 1 on; 0 where in none),
                      word of its row in H_LOADS (0 if it is no wheel),
                      kind for height_kernels, its size; of a heightmap: addresses, rows, columns, size of a cell;
                      two compliances that are added to those of the surface
H_SPACES              ``SPACE_WORDS`` words a movable model: space, whether its links collide among themselves, how
                      many geoms, first body (counted in H_BODIES), how many bodies, whether nothing is near them
H_ISLANDS             ``ISLAND_WORDS`` words a movable model: last step with a contact, representative of its
                      island (itself or a model before it); for a representative: number of contacts, whether a body is
                      awake, whether to solve the island again, change and greatest of the normal forces
H_BOUNDS              ``BOUNDS_WORDS`` words a body: radius of a sphere with its geoms, position at the last check
H_LOADS               ``LOAD_WORDS`` words a wheel: last step with a contact, row of the other geom, word with the
                      force of that contact (0: the next word is its normal force), normal force, normal, room for a
                      dJointFeedback
H_HINGES              ``HINGE_WORDS`` words an axis that rotates: joint, angle with full rotations, integral of its rate
                      since then, which reading of :mod:`m2wr_sim.physics.joint_axes`
H_DAMPED_JOINTS       ``DAMPED_WORDS`` words a damped joint: joint, damping, hinge or slider, stiffness, reference, the
                      motor of an implicit spring or none, its pull
H_DAMPED_LINKS        ``DAMPED_WORDS`` words a damped body: body, parts of linear and angular velocity kept in a step
H_BODIES              all bodies, to check that they stay in the world
H_NOW, H_BEFORE       pairs in contact in this step and in the last: row, row, position, depth
H_LOG                 new contacts: step, row, row, position, depth
H_REPORTS             a ring of contacts of watched geoms: step, row, row, position, normal, depth, dJointFeedback;
                      empty if nothing is watched
H_WORK                working memory for contacts with heightmaps
====================  =======================================================================================
"""
import numpy as np

(H_WORLD, H_GROUP, H_ADDRESS, H_CALLBACK, H_STATIC, H_MOVING, H_SPACE_COUNT, H_CLASS_COUNT, H_CONTACTS, H_PAIRS,
 H_GEOMS, H_SPACES, H_NOW, H_BEFORE, H_LOG, H_NOW_COUNT, H_BEFORE_COUNT, H_LOG_COUNT, H_STEPS, H_QUICK,
 H_SIZE, H_CALLBACK_ITSELF, H_HINGES, H_HINGE_COUNT, H_DAMPED_JOINTS, H_DAMPED_JOINT_COUNT, H_DAMPED_LINKS,
 H_DAMPED_LINK_COUNT, H_BODIES, H_BODY_COUNT, H_LOST, H_WATCHING, H_REPORTS, H_REPORT_COUNT,
 H_CONTACT_PAIR_ROOM, H_LOG_ROOM, H_MISSED, H_BOUNDED, H_BOUNDS, H_PLANE, H_PROBE, H_PROBE_CALLBACK,
 H_FOUND, H_SLEEPERS, H_DT, H_ISLANDS, H_LARGEST_ISLAND, H_ISLAND_LIMIT, H_ITERATIVE, H_GRIPS, H_STATES, H_KEPT,
 H_COUPLED, H_SOLVES, H_KEPT_ROOM, H_IDLERS, H_IDLER_COUNT, H_FORMER, H_FORMER_COUNT,
 H_FORMER_STEP, H_LOADS, H_WORK) = range(62)
HEADER_WORDS = 64

# dContact of libode 0.16 in 8-byte words: surface parameters, then the contact geometry, then the friction direction
CONTACT_WORDS = 31
C_MODE, C_MU, C_MU2, C_BOUNCE, C_BOUNCE_VELOCITY, C_SOFT_ERP, C_SOFT_CFM, C_SLIP1, C_SLIP2 = 0, 1, 2, 6, 7, 8, 9, 13, 14
C_GEOMETRY, C_POSITION, C_NORMAL, C_DEPTH, C_GEOM_ONE, C_GEOM_TWO, C_ALONG = 15, 15, 19, 23, 24, 25, 27
MODE_FDIR1 = np.uint64(2)
MODE_APPROX1 = np.uint64(0x7000)
MAX_FOUND = 150
GEOMETRY_WORDS = 12                     # of a dContactGeom
MOST_OF_MESHES = 0xffff                 # contacts of two meshes: as many as libode's flags can ask for
TRIMESH = 8                             # dTriMeshClass
SAME_PLACE, SAME_DEPTH = 1e-3, 1e-4     # m: of contacts that are one; floors that are told apart differ by more
SAME_DIRECTION = 1.0 - 1e-6             # cosine: 1.4 mrad
RECENT = 32                             # contacts before a new one with which it is compared: more than a robot has
LEAST_KEPT, KEPT_PER_GEOM = 256, 8      # contacts stored in a step: at least, and for each moving geom
KEY_NUMBERS, KEY_ROWS = 256, 1 << 28   # which contact: (row * KEY_ROWS + other row) * KEY_NUMBERS + number in pair
GRIP_WORDS = 27
(J_JOINT, J_FIRST, J_SECOND, J_MU, J_MU2, J_FEEDBACK, J_NORMAL, J_MODEL, J_ISLAND, J_COUPLED, J_KEY, J_ROOM) = range(12)
FORMER_WORDS = 2
STATE_WORDS, T_FROZEN = 20, 19
IDLE_WORDS = 3
I_BODY, I_STEPS, I_TIME = range(IDLE_WORDS)

PAIR_WORDS = 19
(P_VALID, P_MODE, P_MU, P_MU2, P_SLIP1, P_SLIP2, P_BOUNCE, P_BOUNCE_VELOCITY, P_SOFT_ERP, P_SOFT_CFM,
 P_MAX_CONTACTS, P_MERGE, P_GROUND, P_BOTH_MOVE, P_ALONG_X, P_ALONG_Y, P_ALONG_Z, P_ALONG_SECOND, P_SLIDES) = range(19)

GEOM_WORDS = 17
(G_CLASS, G_BODY, G_LINK, G_WATCHED, G_MODEL, G_RESTLESS, G_IDLER, G_LOAD, G_KIND, G_SIZE) = range(10)
FIELD_HEIGHTS, FIELD_ROWS, FIELD_COLUMNS, FIELD_TOPS, FIELD_CELL = range(5)     # after G_SIZE, of a heightmap
G_SLIP1, G_SLIP2 = 15, 16
SPACE_WORDS = 6
S_SPACE, S_MEETS_ITSELF, S_GEOM_COUNT, S_FIRST_BODY, S_BODY_COUNT, S_FREE = range(SPACE_WORDS)
BOUNDS_WORDS = 4
ISLAND_WORDS = 7
X_STEP, X_FOR, X_CONTACTS, X_AWAKE, X_AGAIN, X_CHANGE, X_GREATEST = range(ISLAND_WORDS)
LOAD_WORDS = 23
L_STEP, L_OTHER, L_AT, L_FORCE, L_NORMAL, L_ROOM = 0, 1, 2, 3, 4, 7
HINGE_WORDS = 4
DAMPED_WORDS = 7

CONTACT_PAIR_WORDS, CONTACT_PAIR_ROOM = 6, 128     # initial room for pairs in contact in one step
LOG_WORDS, SPARE_LOG = 7, 256           # the log has room for the pairs of one step more than this
REPORT_WORDS, MAX_REPORTS = 26, 1024
MANY_REPORTS = MAX_REPORTS // 2         # above, reports are read before the next step, which may add as many
R_GEOMETRY, R_FEEDBACK = 3, 10

SHAPE_WORDS, SHAPE_SHIFT, SHAPE_OFFSET = 11, 1, 4       # of a shape whose pose is read, in a table of its own
