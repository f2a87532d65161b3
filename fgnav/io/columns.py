"""Column names of a flight's tables."""

PLACE = ("latitude_deg", "longitude_deg", "height_m")
VELOCITY = ("vn_mps", "ve_mps", "vd_mps")
EULER = ("roll_deg", "pitch_deg", "yaw_deg")
FORCE = ("fx_mps2", "fy_mps2", "fz_mps2")
RATE = ("wx_radps", "wy_radps", "wz_radps")
CURRENTS = ("i1", "i2", "i3", "i4")
CALIBRATION = ("r_quad", "r_c")
HEIGHT = ("height_m",)
FIELD = ("mx_ut", "my_ut", "mz_ut")
POSITION_SIGMA = ("sigma_n_m", "sigma_e_m", "sigma_d_m")
VELOCITY_SIGMA = ("sigma_vn_mps", "sigma_ve_mps", "sigma_vd_mps")
# 1e-13 deg is 10 nm; seconds are kept to 10 ns.
FORMATS = {"t_s": "%.8f", "itude_deg": "%.13f", "_deg": "%.12f"}
