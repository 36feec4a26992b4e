using System;
using UnityEngine;

namespace Gsac
{
    /// <summary>What reaches for a place.</summary>
    public enum GsacEnd
    {
        LeftHand,
        RightHand,
        LeftFoot,
        RightFoot,
    }

    /// <summary>An arm or a leg that reaches for a place: shoulder and elbow, or hip and knee, turn no further than they must.</summary>
    public sealed class GsacLimb
    {
        const float Longest = 0.9995f; // of the limb's length: quite straight it could bend to any side
        const float Nearest = 0.05f;
        const float Hint = 0.02f;

        static readonly string[,] Names =
        {
            { "left_shoulder", "left_elbow", "left_wrist" }, { "right_shoulder", "right_elbow", "right_wrist" },
            { "left_hip", "left_knee", "left_ankle" }, { "right_hip", "right_knee", "right_ankle" },
        };

        public static readonly GsacEnd[] Ends = (GsacEnd[])Enum.GetValues(typeof(GsacEnd));

        public readonly Transform Upper, Middle, Tip;
        readonly Vector3 bend; // whereto a straight one bends, in the frame of Upper: elbows back, knees ahead

        GsacLimb(GsacEnd end, Transform upper, Transform middle, Transform tip)
        {
            Upper = upper;
            Middle = middle;
            Tip = tip;
            bend = new Vector3(0, 0, end == GsacEnd.LeftHand || end == GsacEnd.RightHand ? -1 : 1);
        }

        /// <summary>Null where the skeleton lacks a joint of it.</summary>
        public static GsacLimb Find(GsacData data, Transform[] joints, GsacEnd end)
        {
            int i = (int)end, upper = data.Joint(Names[i, 0]), middle = data.Joint(Names[i, 1]), tip = data.Joint(Names[i, 2]);
            return upper < 0 || middle < 0 || tip < 0 ? null : new GsacLimb(end, joints[upper], joints[middle], joints[tip]);
        }

        /// <summary>
        /// Brings the wrist or ankle to a place in the world, or as near as the limb is long. It bends to the side to which it is bent.
        /// </summary>
        public void Reach(Vector3 place)
        {
            Vector3 a = Upper.position, b = Middle.position, c = Tip.position;
            float above = Vector3.Distance(a, b), below = Vector3.Distance(b, c), length = above + below;
            Vector3 way = place - a, was = Unit(c - a, b - a);
            float least = Math.Max(Nearest * length, Math.Abs(above - below) / Longest);
            float far = Mathf.Clamp(way.magnitude, least, Longest * length);
            Vector3 ahead = Unit(way, was);
            Vector3 side = Across(b - a, was) + Across(Upper.rotation * bend, was) * (Hint * length);
            side = Across(Quaternion.FromToRotation(was, ahead) * side, ahead);
            side = Unit(side, Across(Upper.rotation * new Vector3(0, 1, 0), ahead));
            float along = (above * above + far * far - below * below) / (2 * far);
            Vector3 middle = a + ahead * along + side * Mathf.Sqrt(Math.Max(0, above * above - along * along));
            Upper.rotation = Quaternion.FromToRotation(b - a, middle - a) * Upper.rotation;
            b = Middle.position;
            Middle.rotation = Quaternion.FromToRotation(Tip.position - b, a + ahead * far - b) * Middle.rotation;
        }

        /// <summary>The part of a vector that stands on a direction of length 1.</summary>
        static Vector3 Across(Vector3 v, Vector3 direction)
        {
            return v - direction * Vector3.Dot(v, direction);
        }

        /// <summary>A vector at length 1; of a second one where the first has no length.</summary>
        static Vector3 Unit(Vector3 v, Vector3 other)
        {
            float length = v.magnitude;
            if (length > 1e-6f) return v * (1 / length);
            length = other.magnitude;
            return length > 1e-6f ? other * (1 / length) : Vector3.forward;
        }
    }
}
