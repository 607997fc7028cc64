"""Can this dataset be learned from without errors or warnings? Checks with stable codes, run on any version.

=======  ========  =====================================================================
GD-101   note      a session is still open
GD-103   error     arrays of a session differ in length
GD-105   warning   curation names attempts that this version does not hold
GD-106   error     stored bytes are damaged, or hold what no attempt can have (``verify`` names every one)
GD-107   error     what describes a session is not as recorded
GD-201   error     a value is missing or not finite where the outcome demands one
GD-202   error     a gripper opening is negative or wider than the stroke
GD-203   note      the grasp lies outside the overhead picture
GD-204   warning   a grasp angle is out of range
GD-205   warning   impossible timing: clocks that run backwards or phases longer than the attempt
GD-206   error     the recorded label contradicts the gripper's last reading
GD-207   warning   labels disagree with the simulator's truth too often
GD-208   error     a pose is out of the arm's reach
GD-209   error     the jaws closed under the table, above the camera or in the air, or the camera is under the table
GD-210   error     the grasp lies far outside the overhead picture: nothing of the input shows it
GD-211   error     a number of a station or an attempt is impossible: wrong unit
GD-212   warning   a number of a station or an attempt is unlikely
GD-213   warning   the jaws closed elsewhere than commanded, or the tool does not point down
GD-301   error     a picture is black or of one colour
GD-302   error     a frame is frozen: the same picture as in the attempt before
GD-303   warning   depth is missing in much of a picture
GD-304   error     depth does not fit the height of the camera: wrong unit or scale
GD-305   error     intrinsics do not fit the size of the pictures
GD-306   warning   the same picture was recorded twice
GD-307   note      pictures are near-duplicates
GD-401   warning   one label is rare
GD-402   error     stored folds leak or do not fit this version
GD-403   warning   near-duplicates are in two folds
GD-501   error     a simulated attempt ends otherwise when it is simulated again
GD-502   warning   it ends alike, but some recorded byte differs
GD-503   note      it cannot be simulated again: an older simulator, or a network that is not at hand
GD-504   note      it is the same in every recorded bit
=======  ========  =====================================================================

Excluded attempts are left out: somebody has seen them already. Those of GD-3xx, and GD-403, look at every picture and
run only when asked for. The network's statistics are computed from what is trained on and are not stored, so none can
be stale; folds carry a digest of the attempts and labels they divide (GD-402). A version of an older schema is refused
with the command that migrates it.
"""
