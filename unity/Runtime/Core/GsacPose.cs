using System;

namespace Gsac
{
    /// <summary>
    /// Joint rotations relative to the parents, and a shift of the whole, in Unity's axes. Methods named Smplx take
    /// SMPL-X's numbers: axis-angle in radians, right-handed, y up, person facing +z, left = +x.
    /// </summary>
    public sealed class GsacPose
    {
        public readonly float[] Rotation; // J x 4, x y z w
        public readonly float[] Transl = new float[3];

        public GsacPose(int joints)
        {
            Rotation = new float[joints * 4];
            Reset();
        }

        public int JointCount { get { return Rotation.Length / 4; } }

        /// <summary>T-pose.</summary>
        public void Reset()
        {
            Array.Clear(Rotation, 0, Rotation.Length);
            for (int w = 3; w < Rotation.Length; w += 4) Rotation[w] = 1;
            Array.Clear(Transl, 0, 3);
        }

        public void Copy(GsacPose other)
        {
            Array.Copy(other.Rotation, Rotation, Rotation.Length);
            Array.Copy(other.Transl, Transl, 3);
        }

        /// <summary>Axis-angle in Unity's axes.</summary>
        public void SetAxisAngle(int joint, float x, float y, float z)
        {
            AxisAngle(Rotation, joint * 4, x, y, z);
        }

        public void SetSmplx(int joint, float x, float y, float z)
        {
            AxisAngle(Rotation, joint * 4, x, -y, -z);
        }

        /// <summary>Some joints in a row, three numbers each: global_orient (from joint 0), body_pose (1), jaw_pose (22), ...</summary>
        public void SetSmplx(int firstJoint, float[] axisAngles)
        {
            if (axisAngles.Length % 3 != 0 || firstJoint < 0 || firstJoint + axisAngles.Length / 3 > JointCount)
            {
                throw new ArgumentException(axisAngles.Length + " numbers from joint " + firstJoint + " on; three a joint are expected, "
                                            + JointCount + " joints are there");
            }
            for (int i = 0; i < axisAngles.Length; i += 3)
            {
                SetSmplx(firstJoint + i / 3, axisAngles[i], axisAngles[i + 1], axisAngles[i + 2]);
            }
        }

        public void SetSmplxTransl(float x, float y, float z)
        {
            Transl[0] = -x;
            Transl[1] = y;
            Transl[2] = z;
        }

        /// <summary>
        /// After the root's rotation, its shift or both were set from numbers of a camera's frame (x right, y down, z ahead), as
        /// fits give them: turns the person about the x axis so that it stands upright. pelvis: rest place of joint 0 in Unity's axes.
        /// </summary>
        public void UprightFromCamera(bool rotation, bool shift, float pelvisY, float pelvisZ)
        {
            if (rotation)
            {
                float x = Rotation[0], y = Rotation[1], z = Rotation[2], w = Rotation[3];
                Rotation[0] = w;
                Rotation[1] = -z;
                Rotation[2] = y;
                Rotation[3] = -x;
            }
            if (!shift) return;
            // the turn goes about the origin, the root turns about the pelvis
            Transl[1] = -(Transl[1] + pelvisY) - pelvisY;
            Transl[2] = -(Transl[2] + pelvisZ) - pelvisZ;
        }

        /// <summary>A clip at a time, as often as it says; joints that it does not name do not turn.</summary>
        public void Sample(GsacClip clip, float seconds)
        {
            Sample(clip, seconds, clip.Loop);
        }

        /// <summary>A clip at a time; loop: whether it begins anew after its end, else the last key stands.</summary>
        public void Sample(GsacClip clip, float seconds, bool loop)
        {
            Reset();
            double at = (double)seconds * clip.Fps;
            double step = Math.Floor(at);
            float t = (float)(at - step);
            int k0 = Key(clip, step, loop), k1 = Key(clip, step + 1, loop), width = clip.Joints.Length * 3;
            for (int n = 0; n < clip.Joints.Length; n++)
            {
                int o = clip.Joints[n] * 4, i = k0 * width + n * 3, j = k1 * width + n * 3;
                AxisAngle(Rotation, o, clip.Rotation[i], clip.Rotation[i + 1], clip.Rotation[i + 2]);
                float x = Rotation[o], y = Rotation[o + 1], z = Rotation[o + 2], w = Rotation[o + 3];
                AxisAngle(Rotation, o, clip.Rotation[j], clip.Rotation[j + 1], clip.Rotation[j + 2]);
                Mix(Rotation, o, x, y, z, w, t);
            }
            for (int i = 0; i < 3; i++) Transl[i] = clip.Transl[k0 * 3 + i] * (1 - t) + clip.Transl[k1 * 3 + i] * t;
        }

        /// <summary>s: until a clip is at its last key, or where it loops until it begins anew.</summary>
        public static float Length(GsacClip clip, bool loop)
        {
            return (loop ? clip.Keys : clip.Keys - 1) / clip.Fps;
        }

        static int Key(GsacClip clip, double step, bool loop)
        {
            if (!loop) return (int)Math.Min(Math.Max(step, 0), clip.Keys - 1);
            double turns = Math.Floor(step / clip.Keys);
            return (int)Math.Min(Math.Max(step - turns * clip.Keys, 0), clip.Keys - 1);
        }

        /// <summary>From another pose (t = 0) to this one (t = 1), along the shorter arcs.</summary>
        public void MixFrom(GsacPose other, float t)
        {
            float[] r = other.Rotation;
            for (int o = 0; o < Rotation.Length; o += 4) Mix(Rotation, o, r[o], r[o + 1], r[o + 2], r[o + 3], t);
            for (int i = 0; i < 3; i++) Transl[i] = other.Transl[i] * (1 - t) + Transl[i] * t;
        }

        /// <summary>What is left of a way after some time: exponential smoothing, the same at every frame rate.</summary>
        public static float Stay(float seconds, float timeConstant)
        {
            return timeConstant > 0 ? (float)Math.Exp(-seconds / timeConstant) : 0;
        }

        /// <summary>A joint goes to its turn in another pose; stay: the part of the way that is left.</summary>
        public void Approach(GsacPose goal, int joint, float stay)
        {
            float[] r = goal.Rotation;
            int o = joint * 4;
            Mix(Rotation, o, r[o], r[o + 1], r[o + 2], r[o + 3], stay);
        }

        /// <summary>As Approach, of the shift of the whole.</summary>
        public void ApproachTransl(GsacPose goal, float stay)
        {
            for (int i = 0; i < 3; i++) Transl[i] = goal.Transl[i] + (Transl[i] - goal.Transl[i]) * stay;
        }

        /// <summary>a[o..] becomes the turn from (x, y, z, w) at t = 0 to itself at t = 1, normalised.</summary>
        static void Mix(float[] a, int o, float x, float y, float z, float w, float t)
        {
            float u = a[o] * x + a[o + 1] * y + a[o + 2] * z + a[o + 3] * w < 0 ? -t : t, s = 1 - t;
            float qx = s * x + u * a[o], qy = s * y + u * a[o + 1], qz = s * z + u * a[o + 2], qw = s * w + u * a[o + 3];
            float length = (float)Math.Sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
            float n = length > 0 ? 1 / length : 0;
            a[o] = qx * n;
            a[o + 1] = qy * n;
            a[o + 2] = qz * n;
            a[o + 3] = length > 0 ? qw * n : 1;
        }

        static void AxisAngle(float[] q, int o, float x, float y, float z)
        {
            double angle = Math.Sqrt((double)x * x + (double)y * y + (double)z * z);
            double s = angle > 1e-9 ? Math.Sin(angle / 2) / angle : 0.5;
            q[o] = (float)(x * s);
            q[o + 1] = (float)(y * s);
            q[o + 2] = (float)(z * s);
            q[o + 3] = (float)Math.Cos(angle / 2);
        }

        /// <summary>rotation x y z w to axis-angle.</summary>
        public static void ToAxisAngle(ref float x, ref float y, ref float z, float w)
        {
            double half = Math.Sqrt((double)x * x + (double)y * y + (double)z * z);
            double s = half > 1e-9 ? 2 * Math.Atan2(half, Math.Abs(w)) / half * (w < 0 ? -1 : 1) : 2;
            x = (float)(s * x);
            y = (float)(s * y);
            z = (float)(s * z);
        }

        /// <summary>
        /// Adds to expression weights what a turn of the jaw stands for; x, y, z: axis-angle, in the data's axes.
        /// Bodies whose jaw has skin of its own have zeros there.
        /// </summary>
        public static void AddJaw(GsacData data, float x, float y, float z, float[] weights)
        {
            float[] jaw = data.ExpressionJaw;
            for (int e = 0; e < weights.Length; e++) weights[e] += jaw[e * 3] * x + jaw[e * 3 + 1] * y + jaw[e * 3 + 2] * z;
        }
    }
}
