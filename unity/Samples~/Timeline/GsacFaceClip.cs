using UnityEngine;
using UnityEngine.Playables;
using UnityEngine.Timeline;

namespace Gsac.Samples
{
    /// <summary>A piece of a face track: one expression, as strong as the piece is blended in.</summary>
    public sealed class GsacFaceClip : PlayableAsset, ITimelineClipAsset
    {
        [SerializeField, Tooltip("ARKit's name.")] string expression = "mouthSmileLeft";
        [SerializeField, Range(0, 1)] float weight = 1;

        public ClipCaps clipCaps { get { return ClipCaps.Blending; } }

        public override Playable CreatePlayable(PlayableGraph graph, GameObject owner)
        {
            ScriptPlayable<GsacFacePiece> made = ScriptPlayable<GsacFacePiece>.Create(graph);
            made.GetBehaviour().Expression = expression;
            made.GetBehaviour().Weight = weight;
            return made;
        }
    }

    /// <summary>What a piece asks of the face.</summary>
    public sealed class GsacFacePiece : PlayableBehaviour
    {
        public string Expression;
        public float Weight;
    }
}
