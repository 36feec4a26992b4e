// Stands for the part of UnityEngine that computes, so that the package's C# runs without Unity. API.md: pages and versions.
using System;

namespace UnityEngine
{
    public static class Mathf
    {
        public static float Sqrt(float x) { return (float)Math.Sqrt(x); }
        public const float Rad2Deg = (float)(180 / Math.PI);
        public static float Atan2(float y, float x) { return (float)Math.Atan2(y, x); }
        public static float Exp(float x) { return (float)Math.Exp(x); }
        public static float Clamp(float x, float low, float high) { return Math.Min(Math.Max(x, low), high); }
        public static float DeltaAngle(float from, float to) { return (float)(to - from - 360 * Math.Floor((to - from + 180) / 360)); }
    }

    public struct Vector2
    {
        public float x, y;
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(); } }
        public static Vector3 forward { get { return new Vector3(0, 0, 1); } }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator -(Vector3 a) { return new Vector3(-a.x, -a.y, -a.z); }
        public static Vector3 operator *(Vector3 a, float s) { return new Vector3(a.x * s, a.y * s, a.z * s); }
        public static Vector3 Min(Vector3 a, Vector3 b) { return new Vector3(Math.Min(a.x, b.x), Math.Min(a.y, b.y), Math.Min(a.z, b.z)); }
        public static Vector3 Max(Vector3 a, Vector3 b) { return new Vector3(Math.Max(a.x, b.x), Math.Max(a.y, b.y), Math.Max(a.z, b.z)); }
        public static float Distance(Vector3 a, Vector3 b)
        {
            Vector3 d = a - b;
            return Mathf.Sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
        }
        public float magnitude { get { return Distance(this, zero); } }
        public static float Dot(Vector3 lhs, Vector3 rhs) { return lhs.x * rhs.x + lhs.y * rhs.y + lhs.z * rhs.z; }
    }

    public struct Vector4 : System.IEquatable<Vector4>
    {
        public bool Equals(Vector4 other) { return x == other.x && y == other.y && z == other.z && w == other.w; }
        public float x, y, z, w;
        public Vector4(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Vector4 operator -(Vector4 a, Vector4 b) { return new Vector4(a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w); }
        public static Vector4 operator *(Vector4 a, float s) { return new Vector4(a.x * s, a.y * s, a.z * s, a.w * s); }
    }

    public struct Color
    {
        public float r, g, b, a;
        public Color(float r, float g, float b, float a) { this.r = r; this.g = g; this.b = b; this.a = a; }
        public static Color clear { get { return new Color(); } }
        public static Color white { get { return new Color(1, 1, 1, 1); } }
        public Color linear { get { return new Color(Linear(r), Linear(g), Linear(b), a); } }
        static float Linear(float x) { return x <= 0.04045f ? x / 12.92f : (float)Math.Pow((x + 0.055) / 1.055, 2.4); }
    }

    public struct Rect
    {
        public float x { get; set; }
        public float y { get; set; }
        public float width { get; set; }
        public float height { get; set; }
        public Rect(float x, float y, float width, float height)
        {
            this.x = x;
            this.y = y;
            this.width = width;
            this.height = height;
        }
    }

    public struct Bounds
    {
        public Vector3 center, size;
        public Bounds(Vector3 center, Vector3 size) { this.center = center; this.size = size; }
        public void Encapsulate(Bounds bounds)
        {
            Vector3 least = Vector3.Min(center - size * 0.5f, bounds.center - bounds.size * 0.5f);
            Vector3 most = Vector3.Max(center + size * 0.5f, bounds.center + bounds.size * 0.5f);
            this = new Bounds((least + most) * 0.5f, most - least);
        }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity { get { return new Quaternion(0, 0, 0, 1); } }
        public Vector3 eulerAngles
        {
            get
            {
                Matrix4x4 m = Matrix4x4.TRS(Vector3.zero, this, new Vector3(1, 1, 1));
                double x = Math.Asin(Math.Min(Math.Max(-m.m12, -1), 1)), y = Math.Atan2(m.m02, m.m22), z = Math.Atan2(m.m10, m.m11);
                return new Vector3(Positive(x), Positive(y), Positive(z));
            }
        }
        static float Positive(double radians) { return (float)(radians * 180 / Math.PI + (radians < 0 ? 360 : 0)); }
        public static Quaternion Inverse(Quaternion rotation) { return new Quaternion(-rotation.x, -rotation.y, -rotation.z, rotation.w); }

        // Unity turns about z, then x, then y
        public static Quaternion Euler(float x, float y, float z)
        {
            return About(0, 1, 0, y) * About(1, 0, 0, x) * About(0, 0, 1, z);
        }

        static Quaternion About(float x, float y, float z, float degrees)
        {
            double half = degrees * Math.PI / 360;
            float s = (float)Math.Sin(half);
            return new Quaternion(x * s, y * s, z * s, (float)Math.Cos(half));
        }

        // for the stub of Transform: at length 1, as Unity keeps them
        internal Quaternion Whole()
        {
            float n = 1 / Mathf.Sqrt(x * x + y * y + z * z + w * w);
            return new Quaternion(x * n, y * n, z * n, w * n);
        }

        public static Quaternion FromToRotation(Vector3 fromDirection, Vector3 toDirection)
        {
            Vector3 a = fromDirection, b = toDirection;
            double x = (double)a.y * b.z - (double)a.z * b.y, y = (double)a.z * b.x - (double)a.x * b.z, z = (double)a.x * b.y - (double)a.y * b.x;
            double w = Vector3.Dot(a, b) + (double)a.magnitude * b.magnitude, n = Math.Sqrt(x * x + y * y + z * z + w * w);
            if (n < 1e-12) return identity;
            return new Quaternion((float)(x / n), (float)(y / n), (float)(z / n), (float)(w / n));
        }

        public static Quaternion Slerp(Quaternion a, Quaternion b, float t)
        {
            if (t != 1) throw new NotImplementedException();
            return b;
        }

        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                                  a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }

        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            return Matrix4x4.TRS(Vector3.zero, q, new Vector3(1, 1, 1)).MultiplyPoint3x4(v);
        }
    }

    public struct Matrix4x4
    {
        public float m00, m01, m02, m03, m10, m11, m12, m13, m20, m21, m22, m23, m30, m31, m32, m33;

        public static Matrix4x4 identity { get { return TRS(Vector3.zero, Quaternion.identity, new Vector3(1, 1, 1)); } }
        public static Matrix4x4 Translate(Vector3 t) { return TRS(t, Quaternion.identity, new Vector3(1, 1, 1)); }

        public static Matrix4x4 TRS(Vector3 t, Quaternion q, Vector3 s)
        {
            return new Matrix4x4
            {
                m00 = (1 - 2 * (q.y * q.y + q.z * q.z)) * s.x, m01 = 2 * (q.x * q.y - q.w * q.z) * s.y, m02 = 2 * (q.x * q.z + q.w * q.y) * s.z,
                m10 = 2 * (q.x * q.y + q.w * q.z) * s.x, m11 = (1 - 2 * (q.x * q.x + q.z * q.z)) * s.y, m12 = 2 * (q.y * q.z - q.w * q.x) * s.z,
                m20 = 2 * (q.x * q.z - q.w * q.y) * s.x, m21 = 2 * (q.y * q.z + q.w * q.x) * s.y, m22 = (1 - 2 * (q.x * q.x + q.y * q.y)) * s.z,
                m03 = t.x, m13 = t.y, m23 = t.z, m33 = 1,
            };
        }

        public bool Equals(Matrix4x4 m)
        {
            return Same(GetRow(0), m.GetRow(0)) && Same(GetRow(1), m.GetRow(1)) && Same(GetRow(2), m.GetRow(2)) && Same(GetRow(3), m.GetRow(3));
        }

        static bool Same(Vector4 a, Vector4 b) { return a.x == b.x && a.y == b.y && a.z == b.z && a.w == b.w; }

        public Vector4 GetRow(int r)
        {
            return r == 0 ? new Vector4(m00, m01, m02, m03) : r == 1 ? new Vector4(m10, m11, m12, m13)
                : r == 2 ? new Vector4(m20, m21, m22, m23) : new Vector4(m30, m31, m32, m33);
        }

        public Vector4 GetColumn(int c)
        {
            return c == 0 ? new Vector4(m00, m10, m20, m30) : c == 1 ? new Vector4(m01, m11, m21, m31)
                : c == 2 ? new Vector4(m02, m12, m22, m32) : new Vector4(m03, m13, m23, m33);
        }

        public Vector3 MultiplyPoint3x4(Vector3 p)
        {
            return new Vector3(m00 * p.x + m01 * p.y + m02 * p.z + m03, m10 * p.x + m11 * p.y + m12 * p.z + m13,
                               m20 * p.x + m21 * p.y + m22 * p.z + m23);
        }

        public static Matrix4x4 operator *(Matrix4x4 a, Matrix4x4 b)
        {
            Vector4 p = Combined(a.GetRow(0), b), q = Combined(a.GetRow(1), b), r = Combined(a.GetRow(2), b), s = Combined(a.GetRow(3), b);
            return new Matrix4x4
            {
                m00 = p.x, m01 = p.y, m02 = p.z, m03 = p.w, m10 = q.x, m11 = q.y, m12 = q.z, m13 = q.w,
                m20 = r.x, m21 = r.y, m22 = r.z, m23 = r.w, m30 = s.x, m31 = s.y, m32 = s.z, m33 = s.w,
            };
        }

        // for the stub of Transform
        internal Quaternion Turn()
        {
            double w = Math.Sqrt(Math.Max(0, 1.0 + m00 + m11 + m22)) / 2, x = Math.Sqrt(Math.Max(0, 1.0 + m00 - m11 - m22)) / 2;
            double y = Math.Sqrt(Math.Max(0, 1.0 - m00 + m11 - m22)) / 2, z = Math.Sqrt(Math.Max(0, 1.0 - m00 - m11 + m22)) / 2;
            return new Quaternion((float)(m21 < m12 ? -x : x), (float)(m02 < m20 ? -y : y), (float)(m10 < m01 ? -z : z), (float)w);
        }

        static Vector4 Combined(Vector4 row, Matrix4x4 m)
        {
            return new Vector4(row.x * m.m00 + row.y * m.m10 + row.z * m.m20 + row.w * m.m30, row.x * m.m01 + row.y * m.m11 + row.z * m.m21 + row.w * m.m31,
                               row.x * m.m02 + row.y * m.m12 + row.z * m.m22 + row.w * m.m32, row.x * m.m03 + row.y * m.m13 + row.z * m.m23 + row.w * m.m33);
        }

        // for the stub of Transform: inverse of an affine matrix
        internal Matrix4x4 Inverted()
        {
            double a = m00, b = m01, c = m02, d = m10, e = m11, f = m12, g = m20, h = m21, i = m22;
            double s = 1 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g));
            var n = new Matrix4x4
            {
                m00 = (float)((e * i - f * h) * s), m01 = (float)((c * h - b * i) * s), m02 = (float)((b * f - c * e) * s),
                m10 = (float)((f * g - d * i) * s), m11 = (float)((a * i - c * g) * s), m12 = (float)((c * d - a * f) * s),
                m20 = (float)((d * h - e * g) * s), m21 = (float)((b * g - a * h) * s), m22 = (float)((a * e - b * d) * s), m33 = 1,
            };
            Vector3 t = n.MultiplyPoint3x4(new Vector3(m03, m13, m23));
            n.m03 = -t.x;
            n.m13 = -t.y;
            n.m23 = -t.z;
            return n;
        }
    }
}
