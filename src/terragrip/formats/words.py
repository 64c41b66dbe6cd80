"""The words of the trade, in seven languages, some in Chinese, and as abbreviations, and the units that words stand for.

Not a list of loggers: a word stands here for what it means everywhere.
"""

from __future__ import annotations

MEANINGS: dict[str, str] = {
    # what is measured
    "speed": "speed velocity vel spd v sog geschwindigkeit vitesse velocidad velocidade velocita snelheid",
    "rotation": "rpm rps omega w rotation rotacao drehzahl toerental regime",
    "torque": "torque effort moment drehmoment tau tq trq md couple par coppia koppel",
    "current": "current curr amps amp ampere strom corrente",
    "acceleration": "acceleration accelerometer acc accel beschleunigung aceleracion aceleracao accelerazione versnelling",
    "gyro": "gyroscope gyro gyr",
    "rate": "rate angular turn",
    "pitch": "pitch assiette nick nickwinkel neigung tangage cabeceo beccheggio slope incline inclination steigung pente "
    "pendiente pendenza",
    "roll": "roll bank wank wankwinkel querneigung roulis balanceo rollio",
    "yaw": "yaw psi gier lacet imbardata",
    "heading": "heading hdg course bearing azimuth cog compass",
    "latitude": "latitude breitengrad",
    "longitude": "longitude longtitude laengengrad",
    "altitude": "altitude alt height elevation hoehe",
    "position": "position pose pos easting northing utm",
    "pull": "drawbar draft draught pull traction tractive zugkraft traino tiro tracao trekkracht fdraw fzug ftow fpull",
    "coupling": "hitch towing trailer attelage koppelpunkt hook haken deichsel coupler",
    "force": "force kraft fuerza forza forca",
    "mass": "mass weight masse gewicht poids peso massa",
    "distance": "distance odometer",
    "time": "time utime timestamp stamp unix epoch clock utc zeit uhrzeit temps heure tiempo hora tempo tijd tow "
    "zeitstempel horodatage",
    # what it is of
    "wheel": "wheel whl rim tire tyre joint roue rueda ruota roda wiel axle achse essieu eje assale rad theoretical theorique "
    "theoretisch theoretische teorica teorico radumfangs",
    "motor": "motor moteur motore antrieb antriebs esc drive",
    "ground": "ground gnd gps gnss radar navigation visual vio lidar icp doppler true location rtk ublox slam "
    "grund boden sol suelo suolo",
    "body": "vehicle machine car robot body base ego tractor gross gesamt fahrzeug fzg obd avancement",
    "odometry": "odom odometry",
    "soil": "soil terrain surface",
    "other": "engine pto shaft driveshaft fan pump gearbox transmission battery brake steering steer throttle pedal ignition fuel "
    "oil coolant boost wind magnetometer magnetic mag camshaft injector injection turbo clutch compressor alternator carrier "
    "pseudorange satellite cylinder gear intake exhaust propeller idle encoder limiter bumper cliff charger gravity "
    "air diff lock limiting ecef hydraulic valve grinder blade reel auger spool lever joystick crank zapfwelle zapfwellen lenkwinkel "
    "getriebe rocker bogie boom bucket header cutter cutterbar mast crane ride gestaenge ausleger schneidwerk hubwerk hubwerks hubhoehe "
    "suspension akku batterie brems bremse bremsen frein freno",
    # what is no measurement of it
    "command": "cmd command commanded set setpoint target desired reference ref demand demanded requested request limit max "
    "maximum min minimum nominal available expected predicted ideal selected soll sollwert planned "
    "consigne consigna objetivo obiettivo trgt tgt dmd setpt setp goal ff feedforward cruise",
    "statistic": "std stddev var cov covariance variance accuracy error sigma uncertainty quality dop hdop vdop pdop status state "
    "flag id identifier count counter index idx raw mode valid fix number checksum seq ticks pwm voltage volt temperature "
    "temp pressure power load derivative correction offset trim level duty percent pct jerk energy frequency slip confidence "
    "bias deviation scale ratio gain residual label relative rlv rel magnitude norm total wear",
    # along which axis
    "longitudinal": "longitudinal forward fwd laengs",
    "lateral": "lateral side sideways transverse quer",
    "vertical": "vertical vert down up climb sink",
    "east": "east easting",
    "north": "north northing",
    "left": "left l li links gauche izquierda izquierdo esquerda esquerdo sinistra sinistro",
    "right": "right r re rechts droite derecha derecho direita direito destra destro",
    "front": "front vorn vorne vorder avant delantera delantero dianteira dianteiro anteriore voor",
    "rear": "rear back hinten hinter arriere trasera trasero traseira traseiro posteriore achter",
    "middle": "middle mid centre center mitte mittig milieu medio centrale midden",
    "change": "delta d",
    "angle": "angle winkel angolo angulo",
    "value": "val value wert",  # says nothing more
}  # fmt: skip
CORNERS = {
    **dict.fromkeys(("fl", "lf", "vl"), "fl"), **dict.fromkeys(("fr", "rf", "vr"), "fr"),
    **dict.fromkeys(("rl", "lr", "bl", "hl"), "rl"), **dict.fromkeys(("rr", "br", "hr"), "rr"),
    **dict.fromkeys(("ml", "lm"), "ml"), **dict.fromkeys(("mr", "rm"), "mr"),
}  # fmt: skip
FRENCH_CORNERS = {"avg": "fl", "avd": "fr", "arg": "rl", "ard": "rr"}
FRENCH = ("roue", "roues", "couple", "couples", "vitesse", "vitesses", "regime", "regimes")
"""Beside one of these words ``avg`` is *avant gauche*; elsewhere it is an average."""
CHINESE = {
    "时间": "time", "时刻": "time", "车速": "vehicle speed", "轮速": "wheel speed", "转速": "rotation", "速度": "speed",
    "加速度": "acceleration", "角速度": "angular velocity", "横摆": "yaw", "航向": "heading", "俯仰": "pitch", "侧倾": "roll",
    "扭矩": "torque", "转矩": "torque", "电流": "current", "牵引力": "drawbar pull", "车轮": "wheel", "驱动轮": "wheel",
    "轮": "wheel", "电机": "motor", "发动机": "engine", "左": "left", "右": "right", "前": "front", "后": "rear",
    "纵向": "longitudinal", "横向": "lateral", "垂向": "vertical", "纬度": "latitude", "经度": "longitude", "海拔": "altitude",
    "高度": "altitude", "制动": "brake", "油门": "throttle", "目标": "target", "期望": "target", "设定": "target",
    "最大": "max", "里程": "distance", "滑转率": "slip", "温度": "temperature", "电压": "voltage", "压力": "pressure",
    "质量": "mass", "状态": "state", "方向盘": "steering",
}  # fmt: skip
"""Chinese has no blanks between words: the longest that fits is read first."""
UNIT_WORDS = {
    "kmh": "km/h", "kph": "km/h", "mph": "mph", "knots": "knots", "knot": "knots", "kn": "kN", "rpm": "rpm", "rps": "rev/s",
    "dps": "deg/s", "ips": "in/s", "degs": "deg/s", "rads": "rad/s", "deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad",
    "radians": "rad", "nm": "N m", "knm": "kNm", "n": "N", "m": "m", "meter": "m", "meters": "m", "metres": "m", "mm": "mm",
    "cm": "cm", "g": "g", "ms2": "m/s^2", "mss": "m/s^2", "s": "s", "sec": "s", "secs": "s", "seconds": "s", "second": "s",
    "millisecond": "ms", "microsecond": "us", "nanosecond": "ns",
    "millis": "ms", "ms": "ms", "milliseconds": "ms", "micros": "us", "us": "us", "microseconds": "us", "nanos": "ns",
    "ns": "ns", "nanoseconds": "ns", "nsec": "ns", "usec": "us", "msec": "ms", "a": "A", "amps": "A", "ma": "mA",
    "mnm": "mNm", "dan": "daN", "danm": "daNm", "mrad": "mrad",
    "percent": "%", "pct": "%", "kg": "kg", "lbs": "lbs", "lbf": "lbf", "klbf": "klbf", "kgf": "kgf", "kip": "kip", "kips": "kip",
    **dict.fromkeys(("lbft", "ftlb", "ftlbs", "lbfft", "ftlbf"), "lbf ft"), **dict.fromkeys(("inlb", "inlbs", "lbin", "inlbf"), "lbf in"),
}  # fmt: skip
