namespace Gsac
{
    /// <summary>Why a datagram was not taken as a message of a pose stream.</summary>
    public enum GsacMessageFault
    {
        /// <summary>It was taken.</summary>
        None,
        /// <summary>It begins neither as JSON nor as OSC.</summary>
        Kind,
        /// <summary>It ends before it is whole, or a length in it points past its end.</summary>
        Truncated,
        /// <summary>It is not written by the rules of JSON or OSC.</summary>
        Form,
        /// <summary>A known key or address comes with fewer or more numbers than it has.</summary>
        Numbers,
        /// <summary>A number is not finite or beyond 1000, or a quaternion is zero.</summary>
        Value,
        /// <summary>Tables, lists or bundles lie too deep in each other.</summary>
        Depth,
    }
}
