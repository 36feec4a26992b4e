using System.Text;

namespace Gsac
{
    /// <summary>
    /// Reads one JSON message of a pose stream into a pose and expression weights, and allocates nothing.
    /// { "joints": {"left_elbow": [x, y, z], ...}, "global_orient": [3], "body_pose": [63], "jaw_pose": [3], "leye_pose": [3],
    ///   "reye_pose": [3], "left_hand_pose": [45], "right_hand_pose": [45], "transl": [3], "camera": true,
    ///   "expression": {"jawOpen": 0.5, ...} or [weights in order] }
    /// All keys may be left out, unknown ones are passed over. Numbers as in SMPL-X (GsacPose).
    /// </summary>
    public sealed class GsacPoseMessage
    {
        const int MaxDepth = 16;
        const float MaxValue = 1000;
        static readonly byte[][] GroupNames = Bytes("global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose",
                                                    "left_hand_pose", "right_hand_pose");
        static readonly int[] GroupFirst = { 0, 1, 22, 23, 24, 25, 40 };
        static readonly int[] GroupJoints = { 1, 21, 1, 1, 1, 15, 15 };
        static readonly byte[][] Keys = Bytes("joints", "transl", "camera", "expression");

        readonly byte[][] joints;
        readonly byte[][] expressions;
        readonly float pelvisX, pelvisY, pelvisZ;
        readonly GsacPose pose;
        readonly float[] weights;
        readonly float[] row = new float[63];
        byte[] text;
        int at, end, keyStart, keyEnd;
        bool camera;

        /// <summary>data: in Unity's axes.</summary>
        public GsacPoseMessage(GsacData data)
        {
            joints = Bytes(data.JointNames);
            expressions = Bytes(data.Expressions);
            pose = new GsacPose(data.JointCount);
            weights = new float[expressions.Length];
            pelvisX = data.Joints[0];
            pelvisY = data.Joints[1];
            pelvisZ = data.Joints[2];
        }

        static byte[][] Bytes(params string[] names)
        {
            var all = new byte[names.Length][];
            for (int i = 0; i < names.Length; i++) all[i] = Encoding.UTF8.GetBytes(names[i]);
            return all;
        }

        /// <summary>False where the message is not of this form; the pose and weights are untouched then.</summary>
        public bool Read(byte[] message, int length, GsacPose into, float[] intoWeights)
        {
            text = message;
            at = 0;
            end = length;
            camera = false;
            pose.Copy(into);
            System.Array.Copy(intoWeights, weights, weights.Length);
            if (!Table(0) || Next() != 0) return false;
            if (camera) pose.UprightFromCamera(pelvisX, pelvisY, pelvisZ);
            into.Copy(pose);
            System.Array.Copy(weights, intoWeights, weights.Length);
            return true;
        }

        /// <summary>An object; kind: 0 the message, 1 joints, 2 expression.</summary>
        bool Table(int kind)
        {
            if (Next() != '{') return false;
            at++;
            if (Next() == '}')
            {
                at++;
                return true;
            }
            while (true)
            {
                if (Next() != '"' || !Text()) return false;
                int first = keyStart, last = keyEnd;
                if (Next() != ':') return false;
                at++;
                bool good = kind == 0 ? Member(first, last) : kind == 1 ? Joint(first, last) : Expression(first, last);
                if (!good) return false;
                int c = Next();
                at++;
                if (c == '}') return true;
                if (c != ',') return false;
            }
        }

        bool Member(int first, int last)
        {
            int group = Find(GroupNames, first, last);
            if (group >= 0) return Group(GroupFirst[group], GroupJoints[group]);
            switch (Find(Keys, first, last))
            {
                case 0: return Table(1);
                case 1:
                    if (!Row(3)) return false;
                    pose.SetSmplxTransl(row[0], row[1], row[2]);
                    return true;
                case 2:
                    camera = Next() == 't';
                    return Skip(0);
                case 3: return Next() == '{' ? Table(2) : AllExpressions();
                default: return Skip(0);
            }
        }

        bool Group(int firstJoint, int count)
        {
            if (firstJoint + count > joints.Length || !Row(count * 3)) return false;
            for (int j = 0; j < count; j++) pose.SetSmplx(firstJoint + j, row[j * 3], row[j * 3 + 1], row[j * 3 + 2]);
            return true;
        }

        bool Joint(int first, int last)
        {
            int j = Find(joints, first, last);
            if (j < 0) return Skip(0);
            if (!Row(3)) return false;
            pose.SetSmplx(j, row[0], row[1], row[2]);
            return true;
        }

        bool Expression(int first, int last)
        {
            int e = Find(expressions, first, last);
            if (e < 0) return Skip(0);
            float value;
            if (!Number(out value)) return false;
            weights[e] = value;
            return true;
        }

        bool AllExpressions()
        {
            if (Next() != '[') return false;
            for (int e = 0; e < weights.Length; e++)
            {
                at++;
                if (!Number(out weights[e]) || Next() != (e + 1 < weights.Length ? ',' : ']')) return false;
            }
            if (weights.Length == 0 && (++at >= end || Next() != ']')) return false;
            at++;
            return true;
        }

        bool Row(int count)
        {
            if (Next() != '[') return false;
            for (int i = 0; i < count; i++)
            {
                at++;
                if (!Number(out row[i]) || Next() != (i + 1 < count ? ',' : ']')) return false;
            }
            at++;
            return true;
        }

        bool Number(out float value)
        {
            value = 0;
            int c = Next();
            bool minus = c == '-';
            if (minus) at++;
            double number = 0, place = 1;
            int digits = 0;
            for (; Digit(); at++, digits++) number = number * 10 + (text[at] - '0');
            if (at < end && text[at] == '.')
            {
                for (at++; Digit(); at++, digits++) number += (text[at] - '0') * (place *= 0.1);
            }
            if (digits == 0) return false;
            if (at < end && (text[at] | 32) == 'e')
            {
                at++;
                bool down = at < end && text[at] == '-';
                if (at < end && (text[at] == '-' || text[at] == '+')) at++;
                int exponent = 0, seen = 0;
                for (; Digit(); at++, seen++) exponent = System.Math.Min(exponent * 10 + (text[at] - '0'), 400);
                if (seen == 0) return false;
                number *= System.Math.Pow(10, down ? -exponent : exponent);
            }
            value = (float)(minus ? -number : number);
            return value >= -MaxValue && value <= MaxValue;
        }

        bool Digit()
        {
            return at < end && text[at] >= '0' && text[at] <= '9';
        }

        /// <summary>Passes over a text and notes where it lies between its quotes.</summary>
        bool Text()
        {
            keyStart = ++at;
            while (at < end && text[at] != '"')
            {
                if (text[at] < 32) return false;
                at += text[at] == '\\' ? 2 : 1;
            }
            keyEnd = at;
            return at++ < end;
        }

        /// <summary>Passes over a value.</summary>
        bool Skip(int depth)
        {
            int c = Next();
            if (depth > MaxDepth) return false;
            if (c == '"') return Text();
            if (c == '{' || c == '[')
            {
                int close = c == '{' ? '}' : ']';
                at++;
                if (Next() == close)
                {
                    at++;
                    return true;
                }
                while (true)
                {
                    if (c == '{')
                    {
                        if (Next() != '"' || !Text() || Next() != ':') return false;
                        at++;
                    }
                    if (!Skip(depth + 1)) return false;
                    int after = Next();
                    at++;
                    if (after == close) return true;
                    if (after != ',') return false;
                }
            }
            int start = at;
            while (at < end && (text[at] == '-' || text[at] == '+' || text[at] == '.' || Digit() || (text[at] | 32) >= 'a' && (text[at] | 32) <= 'z')) at++;
            return at > start;
        }

        /// <summary>The next character that is no blank; 0 at the end.</summary>
        int Next()
        {
            while (at < end && (text[at] == ' ' || text[at] == '\n' || text[at] == '\r' || text[at] == '\t')) at++;
            return at < end ? text[at] : 0;
        }

        int Find(byte[][] names, int first, int last)
        {
            for (int n = 0; n < names.Length; n++)
            {
                byte[] name = names[n];
                if (name.Length != last - first) continue;
                int i = 0;
                while (i < name.Length && name[i] == text[first + i]) i++;
                if (i == name.Length) return n;
            }
            return -1;
        }
    }
}
