using System;

namespace Gsac
{
    /// <summary>
    /// Reads one JSON message of a pose stream into a draft, and allocates nothing.
    /// { "joints": {"left_elbow": [x, y, z], ...}, "global_orient": [3], "body_pose": [63], "jaw_pose": [3], "leye_pose": [3],
    ///   "reye_pose": [3], "left_hand_pose": [45], "right_hand_pose": [45], "transl": [3], "camera": true,
    ///   "expression": {"jawOpen": 0.5, ...} or [weights in order] }
    /// All keys may be left out, unknown ones are passed over. Numbers as in SMPL-X (GsacPose).
    /// </summary>
    public sealed class GsacPoseJson
    {
        const int MaxDepth = 16;
        static readonly byte[][] Keys = GsacPoseDraft.Bytes("joints", "transl", "camera", "expression");

        readonly GsacPoseDraft draft;
        byte[] text;
        int at, end, keyStart, keyEnd;
        GsacMessageFault fault;

        public GsacPoseJson(GsacPoseDraft draft)
        {
            this.draft = draft;
        }

        public GsacMessageFault Read(byte[] message, int length)
        {
            text = message;
            at = 0;
            end = length;
            fault = GsacMessageFault.None;
            if (Table(0) && Next() == 0 && at >= end) return GsacMessageFault.None;
            return fault != GsacMessageFault.None ? fault : at >= end ? GsacMessageFault.Truncated : GsacMessageFault.Form;
        }

        bool Fail(GsacMessageFault why)
        {
            fault = why;
            return false;
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
            int group = draft.Group(text, first, last);
            if (group >= 0)
            {
                int length = draft.GroupLength(group);
                if (length == 0) return Skip(0);
                if (!Row(length)) return false;
                draft.SetGroup(group);
                return true;
            }
            switch (GsacPoseDraft.Find(Keys, text, first, last))
            {
                case 0: return Table(1);
                case 1:
                    if (!Row(3)) return false;
                    draft.SetTransl();
                    return true;
                case 2:
                    draft.Camera = Next() == 't';
                    return Skip(0);
                case 3:
                    if (Next() == '{') return Table(2);
                    if (!Row(draft.Expressions)) return false;
                    draft.SetExpressions();
                    return true;
                default: return Skip(0);
            }
        }

        bool Joint(int first, int last)
        {
            int j = draft.Joint(text, first, last);
            if (j < 0) return Skip(0);
            if (!Row(3)) return false;
            draft.SetJoint(j, 0);
            return true;
        }

        bool Expression(int first, int last)
        {
            int e = draft.Expression(text, first, last);
            if (e < 0) return Skip(0);
            float value;
            if (!Number(out value)) return false;
            draft.SetExpression(e, value);
            return true;
        }

        /// <summary>A list of exactly so many numbers, into the draft's row.</summary>
        bool Row(int count)
        {
            if (Next() != '[') return false;
            at++;
            for (int i = 0; i < count; i++)
            {
                if (Next() == ']') return Fail(GsacMessageFault.Numbers);
                if (!Number(out draft.Row[i])) return false;
                int after = Next();
                bool over = i + 1 == count;
                if (after == (over ? ',' : ']')) return Fail(GsacMessageFault.Numbers);
                if (after != (over ? ']' : ',')) return false;
                if (!over) at++;
            }
            if (Next() != ']') return Fail(GsacMessageFault.Numbers);
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
                for (; Digit(); at++, seen++) exponent = Math.Min(exponent * 10 + (text[at] - '0'), 400);
                if (seen == 0) return false;
                number *= Math.Pow(10, down ? -exponent : exponent);
            }
            value = (float)(minus ? -number : number);
            return GsacPoseDraft.Plain(value) || Fail(GsacMessageFault.Value);
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
            if (depth > MaxDepth) return Fail(GsacMessageFault.Depth);
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
    }
}
