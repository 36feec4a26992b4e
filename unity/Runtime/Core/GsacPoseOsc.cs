using System;

namespace Gsac
{
    /// <summary>
    /// Reads one OSC 1.0 packet, a message or a bundle of them, into a draft, and allocates nothing.
    /// /gsac/joint/NAME fff, /gsac/GROUP f..., /gsac/transl fff, /gsac/camera T, /gsac/expression/NAME f, /gsac/expression f...:
    /// numbers and names as in the JSON message. /VMC/Ext/Bone/Pos sfffffff (rotations alone) and /VMC/Ext/Blend/Val sf: what motion
    /// capture programs send by the VMC protocol. Other addresses are passed over, patterns are not expanded, bundles are
    /// applied when they come, whatever their time tag says. Numbers may come as f, d, i, h, T or F.
    /// </summary>
    public sealed class GsacPoseOsc
    {
        const int MaxDepth = 8;
        const int BundleHead = 16;
        static readonly byte[][] Roots = GsacPoseDraft.Bytes("/gsac/", "/VMC/Ext/");
        static readonly byte[][] Own = GsacPoseDraft.Bytes("transl", "camera", "expression");
        static readonly byte[][] OwnNamed = GsacPoseDraft.Bytes("joint/", "expression/");
        static readonly byte[][] Vmc = GsacPoseDraft.Bytes("Bone/Pos", "Blend/Val");
        static readonly byte[][] BundleWord = GsacPoseDraft.Bytes("#bundle\0");

        readonly GsacPoseDraft draft;
        byte[] data;
        int numbers, wordFirst, wordLast;
        bool plain;

        public GsacPoseOsc(GsacPoseDraft draft)
        {
            this.draft = draft;
        }

        public GsacMessageFault Read(byte[] packet, int length)
        {
            data = packet;
            return Element(0, length, 0);
        }

        GsacMessageFault Element(int first, int last, int depth)
        {
            if (depth > MaxDepth) return GsacMessageFault.Depth;
            if ((last - first) % 4 != 0) return GsacMessageFault.Truncated;
            if (first < last && data[first] == '/') return Message(first, last);
            if (last - first < BundleHead || !Begins(BundleWord[0], first, last)) return GsacMessageFault.Form;
            int at = first + BundleHead;
            while (at < last)
            {
                int size = Int(at);
                at += 4;
                if (size <= 0) return GsacMessageFault.Form;
                if (size > last - at) return GsacMessageFault.Truncated;
                GsacMessageFault fault = Element(at, at + size, depth + 1);
                if (fault != GsacMessageFault.None) return fault;
                at += size;
            }
            return GsacMessageFault.None;
        }

        GsacMessageFault Message(int first, int last)
        {
            int addressEnd = TextEnd(first, last);
            if (addressEnd < 0) return GsacMessageFault.Truncated;
            GsacMessageFault fault = Arguments(After(addressEnd), last);
            if (fault != GsacMessageFault.None) return fault;
            if (Begins(Roots[0], first, addressEnd)) return OwnMessage(first + Roots[0].Length, addressEnd);
            if (Begins(Roots[1], first, addressEnd)) return VmcMessage(first + Roots[1].Length, addressEnd);
            return GsacMessageFault.None;
        }

        /// <summary>Walks over all arguments; the numbers go to the row, the first text is noted.</summary>
        GsacMessageFault Arguments(int at, int last)
        {
            numbers = wordFirst = wordLast = 0;
            plain = true;
            if (at == last) return GsacMessageFault.None;
            if (data[at] != ',') return GsacMessageFault.Form;
            int tag = at + 1, tagsEnd = TextEnd(at, last);
            if (tagsEnd < 0) return GsacMessageFault.Truncated;
            at = After(tagsEnd);
            for (; tag < tagsEnd; tag++)
            {
                int end = ArgumentEnd(data[tag], at, last);
                if (end == Unknown) return GsacMessageFault.Form;
                if (end < 0 || end > last) return GsacMessageFault.Truncated;
                switch ((char)data[tag])
                {
                    case 'f': Put(Real(at)); break;
                    case 'd': Put(Double(at)); break;
                    case 'i': Put(Int(at)); break;
                    case 'h': Put(Long(at)); break;
                    case 'T': Put(1); break;
                    case 'F': Put(0); break;
                    case 's':
                        if (wordLast == 0)
                        {
                            wordFirst = at;
                            wordLast = TextEnd(at, last);
                        }
                        break;
                }
                at = end;
            }
            return at == last ? GsacMessageFault.None : GsacMessageFault.Form;
        }

        const int Unknown = -2;

        /// <summary>Where an argument ends; -1 where it has no end, Unknown for a tag that OSC 1.0 does not know.</summary>
        int ArgumentEnd(byte tag, int at, int last)
        {
            switch ((char)tag)
            {
                case 'i': case 'f': case 'c': case 'r': case 'm': return at + 4;
                case 'h': case 'd': case 't': return at + 8;
                case 'T': case 'F': case 'N': case 'I': case '[': case ']': return at;
                case 's': case 'S':
                    int end = TextEnd(at, last);
                    return end < 0 ? -1 : After(end);
                case 'b':
                    if (last - at < 4) return -1;
                    int size = Int(at);
                    return size < 0 || size > last - at - 4 ? -1 : at + 4 + (size + 3 & ~3);
                default: return Unknown;
            }
        }

        void Put(double value)
        {
            if (numbers < draft.Row.Length)
            {
                draft.Row[numbers] = (float)value;
                plain &= GsacPoseDraft.Plain((float)value);
            }
            numbers++;
        }

        GsacMessageFault OwnMessage(int first, int last)
        {
            int group = draft.Group(data, first, last);
            if (group >= 0)
            {
                int length = draft.GroupLength(group);
                if (length == 0) return GsacMessageFault.None;
                if (!Fits(length, true)) return Misfit();
                draft.SetGroup(group);
                return GsacMessageFault.None;
            }
            switch (GsacPoseDraft.Find(Own, data, first, last))
            {
                case 0:
                    if (!Fits(3, true)) return Misfit();
                    draft.SetTransl();
                    return GsacMessageFault.None;
                case 1:
                    if (!Fits(1, true)) return Misfit();
                    draft.Camera = draft.Row[0] != 0;
                    return GsacMessageFault.None;
                case 2:
                    if (!Fits(draft.Expressions, true)) return Misfit();
                    draft.SetExpressions();
                    return GsacMessageFault.None;
            }
            if (Begins(OwnNamed[0], first, last))
            {
                int joint = draft.Joint(data, first + OwnNamed[0].Length, last);
                if (joint < 0) return GsacMessageFault.None;
                if (!Fits(3, true)) return Misfit();
                draft.SetJoint(joint, 0);
            }
            else if (Begins(OwnNamed[1], first, last))
            {
                int expression = draft.Expression(data, first + OwnNamed[1].Length, last);
                if (expression < 0) return GsacMessageFault.None;
                if (!Fits(1, true)) return Misfit();
                draft.SetExpression(expression, draft.Row[0]);
            }
            return GsacMessageFault.None;
        }

        GsacMessageFault VmcMessage(int first, int last)
        {
            switch (GsacPoseDraft.Find(Vmc, data, first, last))
            {
                case 0:
                    int bone = draft.Bone(data, wordFirst, wordLast);
                    if (bone < 0) return GsacMessageFault.None;
                    if (!Fits(7, false)) return Misfit();
                    return draft.SetRotation(bone, 3) ? GsacMessageFault.None : GsacMessageFault.Value;
                case 1:
                    int expression = draft.Expression(data, wordFirst, wordLast);
                    if (expression < 0) return GsacMessageFault.None;
                    if (!Fits(1, false)) return Misfit();
                    draft.SetExpression(expression, draft.Row[0]);
                    return GsacMessageFault.None;
                default: return GsacMessageFault.None;
            }
        }

        bool Fits(int count, bool exactly)
        {
            return plain && (exactly ? numbers == count : numbers >= count);
        }

        GsacMessageFault Misfit()
        {
            return plain ? GsacMessageFault.Numbers : GsacMessageFault.Value;
        }

        bool Begins(byte[] word, int first, int last)
        {
            if (last - first < word.Length) return false;
            int i = 0;
            while (i < word.Length && data[first + i] == word[i]) i++;
            return i == word.Length;
        }

        /// <summary>Place of the null that ends a text and its padding within the element; -1 where there is none.</summary>
        int TextEnd(int first, int last)
        {
            int end = first;
            while (end < last && data[end] != 0) end++;
            return end < last && After(end) <= last ? end : -1;
        }

        /// <summary>Where the next part begins, after a text's null and padding.</summary>
        static int After(int end)
        {
            return (end & ~3) + 4;
        }

        int Int(int at)
        {
            return data[at] << 24 | data[at + 1] << 16 | data[at + 2] << 8 | data[at + 3];
        }

        long Long(int at)
        {
            return (long)Int(at) << 32 | (uint)Int(at + 4);
        }

        float Real(int at)
        {
            return new FloatBits { Whole = Int(at) }.Real;
        }

        double Double(int at)
        {
            return BitConverter.Int64BitsToDouble(Long(at));
        }

        [System.Runtime.InteropServices.StructLayout(System.Runtime.InteropServices.LayoutKind.Explicit)]
        struct FloatBits
        {
            [System.Runtime.InteropServices.FieldOffset(0)] public int Whole;
            [System.Runtime.InteropServices.FieldOffset(0)] public float Real;
        }
    }
}
