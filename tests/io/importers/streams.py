"""Streams of receivers, made as their interface descriptions say: raw measurements, solutions.

Raw: ten epochs of six GPS satellites, L1 C/A. Solutions: five epochs of a place, a velocity and the
vector or heading to a second antenna.
"""

import binascii
import struct
from functools import reduce
from operator import xor

import numpy as np

WEEK, TOW_S = 2111, 345_600.0  # 2020-06-25T00:00:00
START_GPS_S = WEEK * 604_800 + TOW_S
CODES_M = 2.1e7 + 1000.0 * np.arange(6)
PHASES_CYCLES = 1.1e8 + np.arange(6.0)
PLACE = (40.33, -3.88, 700.0)
VELOCITY = (1.5, -2.5, 0.25)  # north, east, down; whole centimetres
SIGMA = (0.011, 0.011, 0.021)
VECTOR = (0.1234, -1.4567, 0.0321)  # north, east, down
EPOCHS = 5
SPEED = np.hypot(*VELOCITY[:2])
TRACK_DEG = np.degrees(np.arctan2(VELOCITY[1], VELOCITY[0]))


def _ubx(kind, body):
    """Frame a message of u-blox's."""
    framed = struct.pack("<BBH", kind >> 8, kind & 255, len(body)) + body
    a = b = 0
    for byte in framed:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5\x62" + framed + bytes([a, b])


def raw_ubx():
    """Return RXM-RAWX of u-blox F9's interface manual."""
    out = b""
    for k in range(10):
        body = struct.pack("<dHbBBB2x", TOW_S + k, WEEK, 18, 6, 1, 1)
        for i in range(6):
            body += struct.pack("<ddf", CODES_M[i] + 10 * k, PHASES_CYCLES[i] + 50 * k, -50.0 + i)
            body += struct.pack("<BBBBHBBBBBx", 0, 5 + i, 0, 0, 60000, 45, 4, 4, 6, 7)
        out += _ubx(0x0215, body)
    return out


def pvt(k, fix_type=3):
    """Return NAV-PVT of u-blox F9's interface description, by UTC, 18 s behind GPS time."""
    body = struct.pack("<IHBBBBBB", int(TOW_S + k) * 1000, 2020, 6, 24, 23, 59, 42 + k, 7)
    body += struct.pack("<IiBBBB", 1, 0, fix_type, 1, 0, 12)
    place = (round(PLACE[1] * 1e7), round(PLACE[0] * 1e7), round(PLACE[2] * 1e3))
    body += struct.pack("<iiiiII", *place, 650_000, 11, 21)
    body += struct.pack("<iiiiiII", *(round(1e3 * v) for v in VELOCITY), 2915, 0, 35, 0)
    return _ubx(0x0107, body + struct.pack("<HH4xihH", 100, 0, 0, 0, 0))


def relative(k, flags=0b1_0011_0111 & ~0b1000 | 0b10100):
    """Return NAV-RELPOSNED, version 1: centimetres and tenths of millimetres."""
    tenths = [round(1e4 * x) for x in VECTOR]
    coarse = [int(x / 100) for x in tenths]
    fine = [x - 100 * whole for x, whole in zip(tenths, coarse, strict=True)]
    body = struct.pack("<BBHIiiiii4x", 1, 0, 0, int(TOW_S + k) * 1000, *coarse, 146, 27_515_000)
    body += struct.pack("<bbbbIIIII4xI", *fine, 0, 40, 50, 90, 60, 200_000, flags)
    return _ubx(0x013C, body)


def ubx(**changes):
    return b"".join(pvt(k) + relative(k, **changes) for k in range(EPOCHS))


def old_ubx(k, *, status):
    """Return NAV-POSLLH, NAV-STATUS, NAV-VELNED and NAV-TIMEGPS of u-blox 6's description."""
    tow_ms, cm = int(TOW_S + k) * 1000, [round(1e2 * v) for v in VELOCITY]
    place = (round(PLACE[1] * 1e7), round(PLACE[0] * 1e7), round(PLACE[2] * 1e3), 650_000)
    out = _ubx(0x0102, struct.pack("<IiiiiII", tow_ms, *place, 11, 21))
    if status:
        out += _ubx(0x0103, struct.pack("<IBBBBII", tow_ms, 3 if k else 0, 0xDD, 0, 0, 0, 0))
    out += _ubx(0x0112, struct.pack("<IiiiIIiII", tow_ms, *cm, 0, 0, 0, 4, 0))
    return out + _ubx(0x0120, struct.pack("<IihbBI", tow_ms, 0, WEEK, 18, 7, 0))


def _sbf(number, body):
    """Frame a block of Septentrio's."""
    body += bytes(-(len(body) + 8) % 4)
    framed = struct.pack("<HH", number, len(body) + 8) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(framed, 0)) + framed


def raw_sbf():
    """Return MeasEpoch and EndOfMeas of Septentrio's reference guide; phases lie near the codes."""
    out = b""
    for k in range(10):
        body = struct.pack("<IHBBBBBB", int((TOW_S + k) * 1000), WEEK, 6, 20, 12, 0, 0, 0)
        for i in range(6):
            code = round((CODES_M[i] + 10 * k) * 1000)
            body += struct.pack("<BBBBI", i + 1, 0, 5 + i, code >> 32, code & 0xFFFFFFFF)
            body += struct.pack("<iHbBHBB", round(1e4 * (-50.0 + i)), 1000 * i, 0, 140, 600, 0, 0)
        end = struct.pack("<IHBB", int((TOW_S + k) * 1000), WEEK, 0, 0)
        out += _sbf(4027, body) + _sbf(5922, end)
    return out


def sbf(error=0):
    """Return PVTGeodetic, PosCovGeodetic, VelCovGeodetic, AttEuler, AttCovEuler."""
    out = b""
    for k in range(EPOCHS):
        time = struct.pack("<IH", int(TOW_S + k) * 1000, WEEK)
        place = (*np.radians(PLACE[:2]), PLACE[2], 50.0)
        body = time + struct.pack("<BBdddf", 4, error if k == 0 else 0, *place)
        body += struct.pack("<fffff", VELOCITY[0], VELOCITY[1], -VELOCITY[2], 0.0, 0.0)
        body += struct.pack("<fBBBBHHIBBHHHB", 0.0, 0, 0, 12, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0)
        variances = [*(s**2 for s in SIGMA), *[0.0] * 7]
        angles, none = (123.5, 2.5, -2e10, 0, 0, 0), (-2e10, 0, 0, 0)
        out += _sbf(4007, body) + _sbf(5906, time + struct.pack("<BB10f", 4, 0, *variances))
        out += _sbf(5908, time + struct.pack("<BB10f", 4, 0, *[0.035**2] * 3, *[0.0] * 7))
        out += _sbf(5938, time + struct.pack("<BBHBB6f", 12, 0, 2, 0, 0, *angles))
        out += _sbf(5939, time + struct.pack("<BB6f", 0, 0, 0.3**2, 0.6**2, *none))
    return out


def _novatel(number, body, k):
    """Frame a log of NovAtel's."""
    head = (b"\xaa\x44\x12", 28, number, 0, 0x20, len(body), 0, 100, 180, WEEK)
    head = struct.pack("<3sBHBBHHBBHIIHH", *head, int((TOW_S + k) * 1000), 0, 0, 16000)
    return head + body + struct.pack("<I", ~binascii.crc32(head + body, 0xFFFFFFFF) & 0xFFFFFFFF)


def raw_novatel():
    """Return RANGE of NovAtel's OEM6 reference: L1 C/A, locked, parity known."""
    status = 0x08001C04 | 1 << 10 | 1 << 12
    out = b""
    for k in range(10):
        body = struct.pack("<I", 6)
        for i in range(6):
            body += struct.pack("<HHdf", 5 + i, 0, CODES_M[i] + 10 * k, 0.05)
            body += struct.pack("<dff", -(PHASES_CYCLES[i] + 50 * k), 0.003, -50.0 + i)
            body += struct.pack("<ffI", 45.0, 600.0, status)
        out += _novatel(43, body, k)
    return out


def novatel():
    """Return BESTPOS, BESTVEL and HEADING2 of the OEM7 reference."""
    out = b""
    for k in range(EPOCHS):
        place = (*PLACE[:2], PLACE[2] - 50.0, 50.0)
        body = struct.pack("<IIdddfI3f4sff", 0, 50, *place, 61, *SIGMA, b"AAAA", 0, 0)
        out += _novatel(42, body + bytes(8), k)
        out += _novatel(
            99, struct.pack("<IIffdddf", 0, 50, 0, 0, SPEED, TRACK_DEG, -VELOCITY[2], 0), k
        )
        body = struct.pack("<II6f4s4s", 0, 50, 1.5, 123.5, 2.5, 0, 0.3, 0.6, b"ROVR", b"MAST")
        out += _novatel(1335, body + bytes(8), k)
    return out


def novatel_ascii():
    """Return the same in ASCII."""
    place = f"{PLACE[0]},{PLACE[1]},{PLACE[2] - 50},50.0,WGS84,{SIGMA[0]},{SIGMA[1]},{SIGMA[2]}"
    texts = {"BESTPOS": place, "HEADING2": '1.5,123.5,2.5,0.0,0.3,0.6,"ROVR"'}
    texts["BESTVEL"] = f"0.0,0.0,{SPEED!s},{TRACK_DEG!s},{-VELOCITY[2]},0.0"
    out = b""
    for k in range(EPOCHS):
        for name, text in texts.items():
            head = f"{name}A,COM1,0,90.5,FINESTEERING,{WEEK},{TOW_S + k:.3f},02000000,b1f6,16000"
            body = f'{head};SOL_COMPUTED,NARROW_INT,{text},"AAAA",0.0,0.0'
            crc = ~binascii.crc32(body.encode(), 0xFFFFFFFF) & 0xFFFFFFFF
            out += f"#{body}*{crc:08x}\r\n".encode()
    return out


def raw_rtcm3():
    """Return message 1002 of RTCM 10403: phases equal to the codes."""
    out = b""
    for k in range(10):
        fields = [(1002, 12), (1, 12), (int((TOW_S + k) * 1000), 30), (0, 1), (6, 5), (0, 4)]
        for i in range(6):
            turns, rest = divmod(CODES_M[i] + 10 * k, 299_792.458)
            fields += [(5 + i, 6), (0, 1), (round(rest / 0.02), 24), (0, 20)]
            fields += [(100, 7), (int(turns), 8), (180, 8)]
        bits = "".join(format(value & (1 << width) - 1, f"0{width}b") for value, width in fields)
        bits += "0" * (-len(bits) % 8)
        body = int(bits, 2).to_bytes(len(bits) // 8, "big")
        framed = b"\xd3" + struct.pack(">H", len(body)) + body
        crc = 0
        for byte in framed:  # CRC-24Q
            crc ^= byte << 16
            for _ in range(8):
                crc = crc << 1 ^ (0x1864CFB if crc & 0x800000 else 0)
        out += framed + (crc & 0xFFFFFF).to_bytes(3, "big")
    return out


def sentence(body):
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n"


def gga(time, quality=4, undulation="51.2"):
    place = "4019.8,N,00352.8,W"
    return sentence(f"GNGGA,{time},{place},{quality},12,0.7,648.8,M,{undulation},M,1.0,0001")


def rmc(time, date="010124", status="A"):
    return sentence(f"GNRMC,{time},{status},4019.8,N,00352.8,W,7.8,0.0,{date},,,R")
