using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>What a headset knows of the real room. Components that speak one maker's language: folders Meta and ARFoundation.</summary>
    public interface IGsacRoom
    {
        /// <summary>Whether the room is seen behind what is drawn.</summary>
        void ShowRoom(bool shown);

        /// <summary>False where the headset measures no depth, or none yet.</summary>
        bool TryDepth(GsacRoomDepth depth);

        /// <summary>Where a ray meets the real floor, in the world. False where no floor is known there.</summary>
        bool TryFloor(Vector3 from, Vector3 ahead, out Vector3 place);
    }

    /// <summary>How far the real room is away: an array texture with a slice an eye.</summary>
    public sealed class GsacRoomDepth
    {
        public Texture Texture;

        /// <summary>World -> clip space of the depth's own camera, for each eye.</summary>
        public Matrix4x4[] FromWorld = new Matrix4x4[2];

        /// <summary>m = x / (clip depth + y), with clip depth -1..1.</summary>
        public Vector4 Metres;
    }
}
