namespace Gsac
{
    /// <summary>Reads a datagram of a pose stream, JSON or OSC, into a pose and expression weights, and allocates nothing.</summary>
    public sealed class GsacPoseMessage
    {
        readonly GsacPoseDraft draft;
        readonly GsacPoseJson json;
        readonly GsacPoseOsc osc;

        /// <summary>data: in Unity's axes.</summary>
        public GsacPoseMessage(GsacData data)
        {
            draft = new GsacPoseDraft(data);
            json = new GsacPoseJson(draft);
            osc = new GsacPoseOsc(draft);
        }

        /// <summary>None where it was taken; else `into` is untouched.</summary>
        public GsacMessageFault Read(byte[] message, int length, GsacLivePose into)
        {
            if (length == 0) return GsacMessageFault.Truncated;
            draft.Begin(into);
            int first = message[0];
            GsacMessageFault fault = first == '/' || first == '#' ? osc.Read(message, length)
                : first == '{' || first == ' ' || first == '\n' || first == '\r' || first == '\t' ? json.Read(message, length)
                : GsacMessageFault.Kind;
            if (fault == GsacMessageFault.None) draft.End(into);
            return fault;
        }
    }
}
