"""The physics as pure functions: arrays in, arrays out, SI units, no state.

One subject a module: :mod:`~terragrip.physics.motion` (paper eq. 2 and 3), :mod:`~terragrip.physics.slip`
(eq. 6), :mod:`~terragrip.physics.efficiency` (eq. 4, 5, 7), :mod:`~terragrip.physics.loads`,
:mod:`~terragrip.physics.radius` and :mod:`~terragrip.physics.geodesy`. "Paper" is Kobelski, Osinenko, Streif,
Control Engineering Practice 107, 2021. Everything broadcasts; NaN goes in as "not measured" and comes out as NaN.
"""
